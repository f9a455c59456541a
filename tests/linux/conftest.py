"""A Debian kernel in QEMU: a program runs in it as root, over the host's files, which it cannot change."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
LONGEST_S = 600

# in the order in which they need each other
MODULES = (
    "virtio_ring",
    "virtio",
    "virtio_pci_legacy_dev",
    "virtio_pci_modern_dev",
    "virtio_pci",
    "netfs",
    "fscache",
    "9pnet",
    "9pnet_virtio",
    "9p",
    "overlay",
    "i2c-dev",
    "i2c-smbus",
    "i2c-i801",
    "i2c-stub",
    "i2c-mux",
    "industrialio",
    "kfifo_buf",
    "industrialio-triggered-buffer",
    "inv_sensors_timestamp",
    "inv-mpu6050",
    "inv-mpu6050-i2c",
    "usb-common",
    "usbcore",
    "usbip-core",
    "vhci-hcd",
    "i2c-tiny-usb",
)
# the program loads these itself, with parameters
LATER = ("i2c-stub", "inv-mpu6050-i2c")
PROGRAMS = ("qemu-system-x86_64", "busybox", "iasl", "dpkg-deb")
QEMU = {
    "-accel": "tcg,thread=multi",
    "-cpu": "max",
    "-smp": "2",
    "-m": "768",
    "-M": "q35",
    "-display": "none",
    "-serial": "stdio",
    "-fsdev": "local,id=host,path=/,security_model=none,readonly=on,multidevs=remap",
}
DEVICES = ("edu,addr=4", "virtio-9p-pci,fsdev=host,mount_tag=host")
INIT = """#!/bin/busybox sh
/bin/busybox --install -s /bin
mount -t proc proc /proc; mount -t sysfs sys /sys; mount -t devtmpfs dev /dev
for module in {modules}; do insmod /modules/$module.ko || echo "no $module"; done
mount -t 9p -o trans=virtio,version=9p2000.L,msize=512000,cache=loose,ro host /lower
mount -t tmpfs upper /upper; mkdir -p /upper/files /upper/work
mount -t overlay -o lowerdir=/lower,upperdir=/upper/files,workdir=/upper/work root /root
for folder in proc sys dev; do mount -o bind /$folder /root/$folder; done
mkdir -p /root/modules /root/dev/shm; mount -o bind /modules /root/modules
mount -t tmpfs shm /root/dev/shm; mount -t tmpfs run /root/run; mount -t tmpfs tmp /root/tmp
ip link set lo up
HOME=/run chroot /root {command}
echo "ENDED $?"
poweroff -f
"""


def missing() -> list[str]:
    """The programs that are needed and are not there."""
    return [name for name in PROGRAMS if shutil.which(name) is None]


def boot(package: Path, command: str, table: Path, folder: Path, seconds: float) -> str:
    """What the kernel and `command`, a shell's, print until it ends.

    Parameters
    ----------
    package : a Debian linux-image, unpacked in `folder` alone. table : an ACPI table's source, for QEMU.
    """
    modules = _unpacked(package, folder)
    root = folder / "initramfs"
    for name in ("bin", "lower", "upper", "root", "proc", "sys", "dev", "modules"):
        (root / name).mkdir(parents=True)
    shutil.copy(str(shutil.which("busybox")), root / "bin" / "busybox")
    for module in MODULES:
        shutil.copy(modules[module], root / "modules")
    init = root / "init"
    init.write_text(INIT.format(modules=" ".join(m for m in MODULES if m not in LATER), command=command))
    init.chmod(0o755)
    archive, names = folder / "initramfs.cpio", "\n".join(sorted(str(p.relative_to(root)) for p in root.rglob("*")))
    with archive.open("wb") as out:
        subprocess.run(["busybox", "cpio", "-o", "-H", "newc"], input=names.encode(), stdout=out, cwd=root, check=True)
    subprocess.run(["iasl", "-p", folder / "table", table], check=True, capture_output=True)
    kernel = next(folder.glob("boot/vmlinuz-*"))
    words = ["-kernel", kernel, "-initrd", archive, "-acpitable", f"file={folder / 'table.aml'}"]
    words += ["-append", "console=ttyS0 quiet panic=-1 mitigations=off"]
    words += [word for option in QEMU.items() for word in option]
    words += [word for device in DEVICES for word in ("-device", device)]
    quiet = ["-nodefaults", "-no-user-config", "-no-reboot"]
    ran = subprocess.run(
        ["timeout", "-k", "5", str(seconds), PROGRAMS[0], *quiet, *words],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    return ran.stdout.decode(errors="replace")


def _unpacked(package: Path, folder: Path) -> dict[str, Path]:
    """The kernel and its modules, by name."""
    wanted = ["./boot/vmlinuz-*", *(f"*/{module}.ko" for module in MODULES)]
    with subprocess.Popen(["dpkg-deb", "--fsys-tarfile", package], stdout=subprocess.PIPE) as data:
        subprocess.run(["tar", "-x", "-C", folder, "--wildcards", *wanted], stdin=data.stdout, check=True)
    return {path.stem: path for path in folder.glob("lib/modules/**/*.ko")}


def package():
    named = os.environ.get("MPUCAL_KERNEL")
    found = [Path(named)] if named else sorted((HERE.parents[1] / "build" / "kernel").glob("linux-image-*.deb"))
    if missing() or not found:
        pytest.skip(f"no {', '.join(missing()) or 'kernel: give MPUCAL_KERNEL=linux-image-...deb'}")
    return found[0]


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """By step, what mpucal did and said in that kernel."""
    deb, folder = package(), tmp_path_factory.mktemp("boot")
    output = boot(deb, f"{sys.executable} {HERE / 'guest.py'}", HERE / "mpu.asl", folder, LONGEST_S)
    lines = [json.loads(line[5:]) for line in output.splitlines() if line.startswith("SAID ")]
    assert "ENDED 0" in output, output[-4000:]
    return {line["step"]: line for line in lines}
