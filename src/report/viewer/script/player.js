// Plays an episode.

/** Makes the bar below the map, if there is something to play. */
function makePlayer(view, changed) {
  const { scene, shown } = view;
  if (scene.episodes.length === 0) return null;
  const state = { playing: false, speed: 2, before: 0 };
  const clock = (seconds) => `${seconds.toFixed(1)} s`;
  const length = () => scene.episodes[shown.episode].seconds;
  const time = element("output", { className: "tv-time" });
  const slider = element("input", { type: "range", min: 0, step: 0.1, ariaLabel: "time in the episode" });
  const button = element("button", { type: "button", className: "tv-play" });
  const show = () => {
    slider.max = length();
    slider.value = shown.seconds;
    time.value = `${clock(shown.seconds)} of ${clock(length())}`;
    button.classList.toggle("tv-on", state.playing);
    button.ariaLabel = button.title = state.playing ? "pause" : "play";
  };
  const reveal = () => {
    shown.people = view.peopleBox.checked = true;
    show();
    changed();
  };
  const step = (now) => {
    if (!state.playing || !view.root.isConnected) return;
    shown.seconds = Math.min(length(), shown.seconds + (state.speed * Math.min(now - state.before, 250)) / 1000);
    state.before = now;
    if (shown.seconds >= length()) state.playing = false;
    else requestAnimationFrame(step);
    show();
    changed();
  };
  const toggle = () => {
    state.playing = !state.playing;
    if (state.playing) {
      if (shown.seconds >= length()) shown.seconds = 0;
      state.before = performance.now();
      requestAnimationFrame(step);
    }
    reveal();
  };
  button.onclick = toggle;
  slider.oninput = () => {
    shown.seconds = Number(slider.value);
    reveal();
  };
  const options = (texts) => texts.map((text, value) => element("option", { value }, text));
  const chosen = element("select", { ariaLabel: "episode", onchange: () => {
    shown.episode = Number(chosen.value);
    shown.seconds = 0;
    reveal();
  } }, ...options(scene.episodes.map((episode) => episode.name)));
  chosen.value = shown.episode;
  const SPEEDS = [0.5, 1, 2, 4, 8];
  const speed = element("select", { ariaLabel: "speed", onchange: () => { state.speed = SPEEDS[speed.value]; } },
    ...options(SPEEDS.map((times) => `${times} ×`)));
  speed.value = SPEEDS.indexOf(state.speed);
  show();
  view.togglePlay = toggle;
  return element("div", { className: "tv-player" }, button, slider, time, chosen, speed);
}

