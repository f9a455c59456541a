"""Each line that ends with a remark is wrong, and type checkers say so."""

import numpy as np

import mpucal

recording = mpucal.load("board7/capture.mcap")
calibration = mpucal.calibrate(recording, "autoo")  # wrong
mpucal.calibrate(recording, gravity="9.81")  # wrong
mpucal.load(recording)  # wrong
calibration.D = np.eye(3)  # wrong
calibration.quality["verdict"] = "good"  # wrong
calibration.quality["verdit"]  # wrong
calibration.verdict == "fine"  # wrong
calibration.apply(acc=None)  # wrong
calibration.apply(np.eye(3)).columns  # wrong
mpucal.check(calibration, recording).verdict == "fine"  # wrong
recording.to_dataframe("excel")  # wrong
mpucal.calibrated(recording)  # wrong
