// Speech, tones and vibration. They are off until a tap, as browsers require.

// Pitch [Hz], begin and length [s] of each note; vibration [ms].
const TONES = {
  hold: { notes: [[660, 0, 0.09]], buzz: [40] },
  taken: { notes: [[660, 0, 0.1], [990, 0.11, 0.16]], buzz: [80] },
  wrong: { notes: [[220, 0, 0.16], [165, 0.18, 0.24]], buzz: [60, 60, 60] },
  done: { notes: [[523, 0, 0.14], [659, 0.15, 0.14], [784, 0.3, 0.14], [1047, 0.45, 0.35]], buzz: [300] },
};
let audio = null;

export const on = () => audio !== null;

export function toggle() {
  if (audio) {
    audio.close();
    audio = null;
    self.speechSynthesis?.cancel();
  } else {
    audio = new AudioContext();
    audio.resume();
    say("Sound is on");
    tone("hold");
  }
  return on();
}

export function tone(name) {
  if (!audio) return;
  if (audio.state !== "running") audio.resume();  // after the phone has slept
  for (const [pitch, begin, length] of TONES[name].notes) {
    const from = audio.currentTime + begin, oscillator = audio.createOscillator(), loudness = audio.createGain();
    oscillator.type = name === "wrong" ? "square" : "triangle";
    oscillator.frequency.value = pitch;
    loudness.gain.setValueAtTime(0, from);
    loudness.gain.linearRampToValueAtTime(name === "wrong" ? 0.15 : 0.35, from + 0.01);
    loudness.gain.exponentialRampToValueAtTime(0.001, from + length);
    oscillator.connect(loudness).connect(audio.destination);
    oscillator.start(from);
    oscillator.stop(from + length);
  }
  navigator.vibrate?.(TONES[name].buzz);
}

// Says the text at once; what was being said is out of date.
export function say(text) {
  if (!audio || !self.speechSynthesis) return;
  const spoken = new SpeechSynthesisUtterance(text);
  spoken.lang = document.documentElement.lang;
  spoken.rate = 1.1;
  speechSynthesis.cancel();
  speechSynthesis.speak(spoken);
}
