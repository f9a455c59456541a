"""A Debian kernel in QEMU: a program runs in it as root, over the host's files, which it cannot change.

The guest's clock counts the instructions that it executes, a nanosecond each (-icount), so that measurements there
do not depend on the speed or load of the host; limits are in the guest's time and in the host's processor time.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mpucal.result.calibration import Calibration

HERE = Path(__file__).parent
PACKAGES = HERE.parents[1] / "build" / "kernel"
# In the guest's time and in the host's processor time
LONGEST_S, LONGEST_CPU_S = 900, 3600

# In the order of their dependencies
MODULES = (
    "virtio_ring virtio virtio_pci_legacy_dev virtio_pci_modern_dev virtio_pci netfs fscache 9pnet 9pnet_virtio 9p "
    "overlay i2c-dev i2c-mux industrialio kfifo_buf industrialio-triggered-buffer inv_sensors_timestamp inv-mpu6050 "
    "inv-mpu6050-i2c usb-common usbcore usbip-core vhci-hcd i2c-tiny-usb"
)
OWN = "interrupt"
PROGRAMS = ("qemu-system-x86_64", "busybox", "dpkg-deb", "make", "gcc")
QEMU = {
    "-accel": "tcg",
    "-icount": "shift=0",
    "-cpu": "max",
    "-m": "768",
    "-M": "q35",
    "-display": "none",
    "-serial": "stdio",
    "-append": "console=ttyS0 quiet panic=-1 mitigations=off",
}
QUIET = ("-nodefaults", "-no-user-config", "-no-reboot")
INIT = """#!/bin/busybox sh
/bin/busybox --install -s /bin
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t devtmpfs dev /dev
for module in {modules}; do insmod /modules/$module.ko || echo "no $module"; done
mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=loose,ro host /lower
mount -t tmpfs upper /upper; mkdir -p /upper/files /upper/work
mount -t overlay -o lowerdir=/lower,upperdir=/upper/files,workdir=/upper/work root /root
for folder in proc sys dev; do mount -o bind /$folder /root/$folder; done
mkdir -p /root/modules /root/dev/shm /root/out; mount -o bind /modules /root/modules
mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000 out /root/out
mount -t tmpfs shm /root/dev/shm; mount -t tmpfs run /root/run; mount -t tmpfs tmp /root/tmp
ip link set lo up
HOME=/run timeout {longest_s} chroot /root {command}
echo "ENDED $?"
poweroff -f
"""


@dataclass(frozen=True)
class Guest:
    """Result of a program in that kernel.

    Attributes
    ----------
    said : lines of the guest, by step. out : folder with its files.
    """

    said: dict[str, dict]
    out: Path


@pytest.fixture(scope="module")
def guest(request, tmp_path_factory):
    """Run the part of guest.py that the test module names, on a machine of its own."""
    folder = tmp_path_factory.mktemp("boot")
    (folder / "out").mkdir()
    packages = _packages()
    output = _boot(packages, f"{sys.executable} {HERE / 'guest.py'} {request.module.PART}", folder)
    lines = [json.loads(line[5:]) for line in output.splitlines() if line.startswith("SAID ")]
    assert "ENDED 0" in output, output[-4000:]
    return Guest({line["step"]: line for line in lines}, folder / "out")


def _packages() -> list[Path]:
    """Return the packages of Debian's kernel and its headers."""
    lacking = [name for name in PROGRAMS if shutil.which(name) is None]
    named = Path(os.environ.get("MPUCAL_KERNEL", PACKAGES))
    images, found = sorted(named.glob("linux-image-*.deb")), sorted(named.glob("linux-*.deb"))
    lacking += [] if images else ["linux-image"]
    lacking += [] if len(found) >= 4 else ["linux-headers and linux-kbuild"]
    if lacking:
        pytest.skip(f"no {', '.join(lacking)}: install the programs, and let `make kernel` fetch the kernel's packages")
    return found


def _boot(packages: list[Path], command: str, folder: Path) -> str:
    """Return the output of the kernel and of the shell command `command` until it ends."""
    modules = _unpacked(packages, folder)
    root = folder / "initramfs"
    for name in ("bin", "lower", "upper", "root", "proc", "sys", "dev", "modules"):
        (root / name).mkdir(parents=True)
    shutil.copy(str(shutil.which("busybox")), root / "bin" / "busybox")
    for module in (*MODULES.split(), OWN):
        shutil.copy(modules[module], root / "modules")
    init = root / "init"
    init.write_text(INIT.format(modules=MODULES, longest_s=LONGEST_S, command=command))
    init.chmod(0o755)
    archive, names = folder / "initramfs.cpio", "\n".join(sorted(str(p.relative_to(root)) for p in root.rglob("*")))
    with archive.open("wb") as out:
        subprocess.run(["busybox", "cpio", "-o", "-H", "newc"], input=names.encode(), stdout=out, cwd=root, check=True)
    words = [PROGRAMS[0], *QUIET, "-kernel", next(folder.glob("boot/vmlinuz-*")), "-initrd", archive]
    words += [word for option in QEMU.items() for word in option]
    words += _shared("host", "/", "readonly=on,multidevs=remap") + _shared("out", folder / "out", "readonly=off")
    console = folder / "console"
    with console.open("wb") as out:
        subprocess.run(words, stdin=subprocess.DEVNULL, stdout=out, stderr=out, check=False, preexec_fn=_limit)
    return console.read_text(errors="replace")


def _shared(name: str, path: Path | str, how: str) -> list[str]:
    """Return the options that share a folder of the host, which the guest mounts by `name`."""
    backend = f"local,id={name},path={path},security_model=none,{how}"
    return ["-fsdev", backend, "-device", f"virtio-9p-pci,fsdev={name},mount_tag={name}"]


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_CPU_S, LONGEST_CPU_S))


def _unpacked(packages: list[Path], folder: Path) -> dict[str, Path]:
    """Unpack the kernel and its modules and compile our own; return the modules by name."""
    wanted = ["./boot/vmlinuz-*", *(f"*/{module}.ko" for module in MODULES.split())]
    for package in packages:
        chosen = wanted if package.name.startswith("linux-image-") else ["./usr"]
        with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", package], stdout=subprocess.PIPE) as data:
            subprocess.run(["tar", "-x", "-C", folder, "--wildcards", *chosen], stdin=data.stdout, check=True)
    headers = next(folder.glob("usr/src/linux-headers-*/Module.symvers")).parent
    top = headers / "Makefile"
    # The Makefile includes its other half from the place where that would be installed.
    top.write_text(top.read_text().replace("/usr/src", f"{folder}/usr/src"))
    own = folder / OWN
    own.mkdir()
    shutil.copy(HERE / f"{OWN}.c", own)
    (own / "Kbuild").write_text(f"obj-m := {OWN}.o\n")
    subprocess.run(["make", "-C", headers, f"M={own}", "CC=gcc", "modules"], check=True, capture_output=True)
    return {path.stem: path for path in (*folder.glob("lib/modules/**/*.ko"), own / f"{OWN}.ko")}


@pytest.fixture(scope="session")
def near():
    """near(guest) asserts that D and b_a of its session are the truth's within four standard deviations.

    It returns the calibration.
    """

    def judge(guest):
        assert guest.said["session"]["code"] == 0, guest.said["session"]
        found = Calibration.load(guest.out / "session/calibration.json")
        for name in ("D", "b_a"):
            truth = np.array(guest.said["truth"][name])
            assert (np.abs(getattr(found, name) - truth) < 4 * getattr(found, f"{name}_std")).all()
        return found

    return judge
