// MicroPython itself, as a board: its REPL, its memory and its clock are what the test at stdin and stdout says.
//
//     node board.mjs PACKAGE      PACKAGE: the folder of @micropython/micropython-webassembly-pyscript
//
// Everything that MicroPython waits for is asked of the test, one byte for what, and the test answers, of input with all
// that came: so its time runs only as the test wants it. What the shims below stand in for is the hardware and nothing
// else.
import fs from "fs";
import { pathToFileURL } from "url";

const { loadMicroPython } = await import(pathToFileURL(`${process.argv[2]}/micropython.mjs`));
const BLOBS = ["mpucal_blob0.bin", "mpucal_blob1.bin"];
const SHIMS = {
  "select.py": "import board\nPOLLIN = 1\nclass poll:\n def register(self, *_): pass\n def poll(self, _): return board.poll()\n",
  "ticks.py": "import board\nticks_us = board.ticks\n",
  "machine.py": `
import binascii, board
class Pin:
    def __init__(self, name): self.name = name
def moved(words):
    answer = binascii.unhexlify(board.moved(words))
    if answer[0]: raise OSError(answer[0])
    return answer[1:]
class I2C:
    def __init__(self, number, freq, timeout, sda=None, scl=None):
        if number != 0 or (sda and (sda.name, scl.name) != (4, "SCL")): raise ValueError("I2C(%d) doesn't exist" % number)
    def readfrom(self, address, count): return moved("%02x00%02x" % (address, 0))
    def readfrom_mem(self, address, register, count): return moved("%02x%02x%02x" % (address, register, count))
    def writeto_mem(self, address, register, data):
        moved("%02x%02x00" % (address, register) + binascii.hexlify(data).decode())
SoftI2C = None
`,
};

// collects no garbage while a program runs: the heap holds all that a session makes
let said = [], input = [];
const asked = Buffer.alloc(512);

function tell(kind, bytes = []) {
  if (said.length) {
    const before = said;
    said = [];
    tell("w", before);
  }
  fs.writeSync(1, Buffer.from([kind.charCodeAt(0), bytes.length & 255, bytes.length >> 8, ...bytes]));
}

function answer(count) {
  let at = 0;
  while (at < count) {
    const got = fs.readSync(0, asked, at, count - at, null);
    if (!got) process.exit(0);
    at += got;
  }
  return asked.subarray(0, count);
}

function get() {
  if (!input.length) {
    tell("g");
    input = [...answer(answer(1)[0])];
  }
  return input.shift();
}

const board = {
  get,
  poll: () => (input.length ? 1 : (tell("p"), answer(1)[0])),
  ticks: () => (tell("t"), answer(4).readUInt32LE()),
  moved: (words) => {
    tell("i", Buffer.from(words, "hex"));
    return Buffer.from(answer(answer(1)[0])).toString("hex");
  },
};

async function boot(kept) {
  const mp = await loadMicroPython({
    stdout: (bytes) => said.push(...bytes), stdin: board.get, linebuffer: false, heapsize: 1 << 29,
  });
  mp.registerJsModule("board", board);
  mp.FS.mkdir("/lib");
  for (const [name, text] of Object.entries(SHIMS)) mp.FS.writeFile(`/lib/${name}`, text);
  for (const [name, bytes] of kept) mp.FS.writeFile(name, bytes);
  mp.runPython("import sys\nsys.modules['time'] = __import__('ticks')\ndel sys");
  return mp;
}

let mp = await boot([]), raw = false;
mp.replInit();
for (;;) {
  const byte = board.get();
  if (raw && byte === 5) {
    // its raw-paste mode never asks for a byte in this port: say what a board without that mode says
    for (const _ of "A1") board.get();
    said.push(...Buffer.from("R\0"));
  } else if (mp.replProcessChar(byte)) {
    const kept = BLOBS.filter((name) => mp.FS.analyzePath(name).exists).map((name) => [name, mp.FS.readFile(name)]);
    said.push(...Buffer.from("MPY: soft reboot\r\n"));
    mp = await boot(kept);
    mp.replInit();
    if (raw) mp.replProcessChar(1);
  } else if (byte === 1) raw = true;
  else if (byte === 2) raw = false;
}
