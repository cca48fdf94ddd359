// The transport bar: sends commands if the server allows this page to. In: the streams' messages and frames. Out:
// commands over the same WebSockets. One of several publishers may be selected; a hold and its release always go to all
// of them.

import { answerTo, benchesIn, say, translate } from "./words.js";

/** The numbers of the states of playback. */
const PLAYING = 0, HELD = 2, ENDED = 3;
/** Simulated seconds of one seek by a key. */
const SEEK = 5;
/** The least time between two seeks while the time line is dragged (ms). */
const SEEK_INTERVAL = 100;
/** The time limit of an answer (ms). */
const PATIENCE = 2000;
/** The time for which a sentence is shown (ms). */
const SENTENCE_TIME = 8000;
/** Commands whose refusals are kept: more than a server leaves unanswered. */
const KEPT_REFUSALS = 16;
const RATES = [0.1, 0.25, 0.5, 1, 2, 4, 10];

const BAR = `
  <label id="conduct-choice"><span data-word="conductWhom"></span> <select id="conduct-whom"></select></label>
  <button id="conduct-toggle" data-title="toggleKey"></button>
  <button id="conduct-step" data-title="stepKey" data-word="step"></button>
  <button id="conduct-restart" data-word="restart"></button>
  <label><span data-word="rateInForce"></span> <select id="conduct-rate"></select></label>
  <span id="conduct-time"></span>
  <div id="conduct-line">
    <input id="conduct-seek" type="range" min="0" max="1" step="any" value="0" disabled
      data-label="timeLine" aria-describedby="conduct-events" title="← →">
    <div id="conduct-marks" aria-hidden="true"></div>
    <p id="conduct-events" class="unseen"></p>
  </div>
  <button id="conduct-hold" aria-pressed="false" title="H"></button>
  <p id="conduct-answer" role="status"></p>`;

const TOKEN = "bench-dragon token";

/**
 * Takes the token out of the address at once: others may see the address on the screen. A reload finds the token again.
 */
function takeToken() {
  const given = /(?:^#|[,&])token=([^,&]*)/.exec(location.hash)?.[1];
  if (given !== undefined) {
    const rest = location.hash.slice(1).replace(/(^|[,&])token=[^,&]*/, "").replace(/^[,&]/, "");
    history.replaceState(null, "", rest ? `#${rest}` : location.pathname + location.search);
  }
  try {
    if (given !== undefined) sessionStorage.setItem(TOKEN, given);
    return sessionStorage.getItem(TOKEN);
  } catch {
    // A browser without storage.
    return given ?? null;
  }
}
/** The token for commands, or null. */
export const token = takeToken();

/** Returns true if a certificate of exactly this scene proves the announced time of an event. */
const isProved = (stage, { event, time }) =>
    Boolean(stage.proved?.some((outcome) => outcome.event === event && outcome.status === "proved" &&
    outcome.time_lo <= time && time <= outcome.time_hi));

/** An event on the time line; of several dragons, with its benches. */
function eventWords(stage, { event, time, bench_a, bench_b }) {
  const numbers = stage.dragons.length > 1 ? [bench_a, bench_b].filter((number) => number !== null) : [];
  const kind = numbers.length ? `${say(event)} (${benchesIn(stage, numbers)})` : say(event);
  return say("eventMark",
      { kind, time: time.toFixed(3), proved: isProved(stage, { event, time }) ? say("markProved") : "" });
}

/** A cue on the time line. */
function cueWords({ name, time, pauses }) {
  return say("cueMark", { name, time: time.toFixed(3), waits: pauses ? say("waitsThere") : "" });
}

/** Returns true if the button pauses: any show plays, or all are at their end, where loops wait to begin again. */
function canPause(streams) {
  const all = streams.map(({ playback }) => playback.newest.playback);
  return all.includes(PLAYING) || all.every((one) => one === ENDED);
}

/** Returns true if a publisher can execute commands. */
const isThere = ({ playback, stage, trouble }) => Boolean(playback.newest && stage && trouble === null);

/**
 * `keysConduct`: true if keys conduct; in the show look only on request. `keySwitch` decides whether keys conduct
 * outside the bar.
 */
export function conduct(publishers, keysConduct, keySwitch) {
  const bar = document.getElementById("conduct"), main = bar.parentElement;
  bar.innerHTML = BAR;
  translate(bar);
  const part = (name) => document.getElementById(`conduct-${name}`);
  const line = part("seek"), rates = part("rate");
  const streams = publishers.map(({ stream }) => stream), several = publishers.length > 1;
  const nameOf = (stream) => publishers[streams.indexOf(stream)].name;
  const greeted = new Map(), allowed = new Map();
  /** The refusals of the last commands, by the command's number: a sentence for each stream. */
  const refusals = new Map();
  /** The selected stream, null for all; the number of commands so far, and the command whose refusal is shown. */
  let chosen = null, numbered = 0, refused = 0;
  let shownStages = [], shownRate, dragged = false, sentenceAt = 0;
  /** The target of an unanswered seek, and of a seek that waits for that answer; the time of the last seek sent. */
  let sought = null, wanted = null, soughtAt = -Infinity;
  /** The last answer to a seek: frames from before it are still on their way. */
  let landed = null;
  /** Commands without an answer: each with its number, stream and connection. */
  const unanswered = new Set();
  /**
   * The run of each stream whose rate is known, and that rate: from its frames, or as commanded while the show stands
   * still.
   */
  const known = new Map();

  const targets = () => (chosen ? [chosen] : streams), there = () => targets().filter(isThere);
  /** Returns the stream whose time and speed are shown. */
  const lead = () => chosen ?? streams.find(isThere) ?? streams[0];
  const own = (stream, sentence) => (several ? say("refusedBy", { name: nameOf(stream), sentence }) : sentence);
  const put = (element, text) => element.textContent !== text && (element.textContent = text);
  const seconds = (time) => say("showTime", { time: time.toFixed(1) });
  function report(sentence) {
    put(part("answer"), sentence);
    sentenceAt = performance.now();
  }
  /** Adds the result of a command at one stream to the results of the others. */
  function refuse(id, stream, sentence) {
    const sentences = refusals.get(id) ?? new Map();
    refusals.set(id, sentences.set(stream, own(stream, sentence)));
    report(streams.flatMap((one) => sentences.get(one) ?? []).join(" "));
    refused = id;
  }
  function command(name, value) {
    // A waiting seek is sent before later commands, but not before a hold.
    if (name === "hold") wanted = null;
    if (name !== "seek" && wanted !== null) sendWanted();
    // Commands for all go to the connected streams. A hold and its release go to every stream: a refusal names a stream
    // that was not reached.
    const id = ++numbered, to = name === "hold" || name === "release" ? streams : there().length ? there() : targets();
    refusals.delete(id - KEPT_REFUSALS);
    const unsent = to.filter((stream) => {
      // A show that is shorter than another one stays at its end.
      const within = name === "seek" && stream.stage ? Math.min(value, stream.stage.freeze_time) : value;
      if (!stream.send({ command: name, value: within, id })) return true;
      unanswered.add({ id, stream, socket: stream.socket });
      return false;
    });
    for (const stream of unsent) refuse(id, stream, say("nothingSent"));
    return id;
  }
  /**
   * Reports that a command on a broken connection gets no answer. A seek is not sent again: no user expects the jump
   * later.
   */
  function showLost() {
    for (const one of unanswered) {
      if (one.socket.readyState <= WebSocket.OPEN) continue;
      unanswered.delete(one);
      if (one.id === sought?.id && one.stream === sought.stream) sought = null;
      refuse(one.id, one.stream, say("noAnswer"));
    }
  }
  function toggle() {
    command(targets().length === 1 ? "toggle" : canPause(there()) ? "pause" : "resume");
  }

  // The time line. One seek is pending at a time, so that a fast drag leaves no queue.
  function seek(time) {
    wanted = Math.min(Math.max(0, time), Number(line.max));
    sendSeek();
  }
  /** Seeks from the present time, once a show has given the time line its length. */
  function seekBy(time) {
    if (shownStages.length) seek(now() + time);
  }
  function sendSeek() {
    const passed = performance.now() - soughtAt;
    if (wanted === null || passed < SEEK_INTERVAL || (sought !== null && passed < PATIENCE)) return;
    sendWanted();
  }
  function sendWanted() {
    sought = { time: wanted, id: command("seek", wanted), stream: lead() };
    [wanted, soughtAt] = [null, performance.now()];
  }
  function now() {
    const { newest } = lead().playback, isBefore = landed?.stream === lead() && newest?.run === landed.run &&
        newest.tick < landed.tick;
    return wanted ?? sought?.time ?? (isBefore ? landed.time : newest?.time) ?? 0;
  }

  /** The events and cues of the selected shows, on a line as long as the longest show. */
  function showStages(all) {
    const stages = all.map(({ stage }) => stage);
    if (stages.length === shownStages.length && stages.every((stage, k) => stage === shownStages[k])) return;
    shownStages = stages;
    line.max = Math.max(...stages.map(({ freeze_time }) => freeze_time));
    const marksOf = (stream) => {
      const { stage } = stream, by = (text) => (all.length > 1 ? own(stream, text) : text);
      return [
        ...stage.events.filter(({ time }) => time <= stage.freeze_time).map(
            (event) => ({ kind: event.event, text: by(eventWords(stage, event)), time: event.time })),
        ...stage.cues.map((cue) => ({ kind: "cue", text: by(cueWords(cue)), time: cue.time })),
      ];
    };
    const marks = all.flatMap(marksOf);
    part("marks").replaceChildren(
      ...marks.map(({ kind, text, time }) => {
        const mark = Object.assign(document.createElement("i"), { className: kind === "cue" ? "cue" : "event",
            title: text });
        Object.assign(mark.dataset, { kind, time });
        mark.style.setProperty("--share", time / line.max);
        return mark;
      }),
    );
    put(part("events"), marks.map(({ text }) => text).join(say("between")));
  }
  /** The rate that is in force, or will be once the show plays; null while it is not known. */
  function rateOf(stream) {
    const { newest } = stream.playback, of = known.get(stream);
    return newest && of?.run === newest.run ? of.rate : null;
  }
  const keepRate = (stream, rate) => known.set(stream, { run: stream.playback.newest.run, rate });
  function commandRate(rate) {
    command("rate", rate);
    for (const stream of there()) keepRate(stream, rate);
  }
  function showRate(rate) {
    if (rate === shownRate) return;
    shownRate = rate;
    const all = [...new Set([...RATES, rate ?? 1])].sort((a, b) => a - b);
    rates.replaceChildren(...all.map((one) => new Option(`${+one.toPrecision(3)} ×`, one, false, one === rate)));
    if (rate === null) rates.selectedIndex = -1;
  }
  /** Returns true if all connected shows are held. */
  function allHeld() {
    const all = streams.filter(isThere);
    return all.length > 0 && all.every(({ playback }) => playback.newest.playback === HELD);
  }
  function showHold() {
    if (!streams.some(isThere)) return;
    const held = allHeld();
    put(part("hold"), say(held ? "heldRelease" : "hold"));
    part("hold").setAttribute("aria-pressed", held);
    bar.dataset.held = held;
  }
  function show() {
    const at = performance.now(), all = there();
    if (at - sentenceAt > SENTENCE_TIME) put(part("answer"), "");
    if (bar.hidden) return;
    main.style.setProperty("--conduct-height", `${bar.offsetHeight}px`);
    // A browser ends the drag of a control that is disabled, and sends no event.
    for (const control of bar.querySelectorAll("button, input, select:not(#conduct-whom)")) control.disabled =
        !all.length && !(control === line && dragged);
    // All shows can be held while the selected one is gone.
    part("hold").disabled = !streams.some(isThere);
    showHold();
    showLost();
    // Also while no publisher is there: a seek that waits is refused with a sentence.
    sendSeek();
    if (!all.length) return;
    const { playback } = isThere(lead()) ? lead() : all[0], { newest } = playback;
    showStages(all);
    for (const stream of streams.filter(isThere)) if (stream.playback.newest.scale > 0) keepRate(stream,
        stream.playback.newest.scale);
    showRate(rateOf(isThere(lead()) ? lead() : all[0]));
    put(part("toggle"), say(canPause(all) ? "pause" : "play"));
    const time = dragged || sought !== null || wanted !== null ? now() : playback.time(at);
    // A screen reader reads the value: without digits beyond a tenth.
    if (!dragged) line.value = Math.round(10 * time) / 10;
    line.setAttribute("aria-valuetext", seconds(time));
    put(part("time"), `${time.toFixed(1)} / ${seconds(Number(line.max))}`);
  }

  const receive = (stream) => (message) => {
    if (message.type === "control") {
      // The first message of a connection states whether the token is required; the second, whether it was right.
      if (!message.allowed && token && greeted.get(stream) !== stream.socket) stream.send({ token });
      greeted.set(stream, stream.socket);
      allowed.set(stream, message.allowed);
      bar.hidden = ![...allowed.values()].some(Boolean);
      // The second thumb and the curve of the clearance stand under the time line where there is one.
      if (!bar.hidden) line.parentElement.after(document.getElementById("scrub"), document.getElementById("curve"));
      if (stream === lead()) [sought, wanted] = [null, null];
      show();
    }
    if (message.type === "answer") {
      for (const one of unanswered) if (one.id === message.id && one.stream === stream) unanswered.delete(one);
      if (message.sentence && message.command === "rate") known.delete(stream);
      if (message.id === sought?.id && stream === sought.stream) {
        landed = message.code ? { stream, run: stream.playback.newest?.run, tick: message.tick,
            time: message.sim_time } : null;
        sought = null;
      }
      if (message.sentence) {
        refuse(message.id, stream, answerTo(message));
        // One of several shows may execute an earlier command after a later command did not reach another one.
      } else if (message.code && (several ? message.id > refused : message.id !== refused)) put(part("answer"), "");
      sendSeek();
    }
  };
  for (const stream of streams) stream.onmessage = receive(stream);

  if (several) {
    part("whom").replaceChildren(new Option(say("all"), ""),
        ...publishers.map(({ name }, place) => new Option(name, place)));
    part("whom").onchange = ({ target }) => {
      chosen = target.value === "" ? null : streams[target.value];
      [sought, wanted, landed] = [null, null, null];
      show();
    };
  } else part("choice").remove();
  function changeRate(factor) {
    const rate = rateOf(lead());
    if (rate === null) report(say("rateUnknown"));
    else commandRate(rate * factor);
  }
  const hold = () => command(allHeld() ? "release" : "hold");
  part("toggle").onclick = toggle;
  part("step").onclick = () => command("step", 1);
  part("restart").onclick = () => command("restart");
  part("hold").onclick = hold;
  rates.onchange = () => {
    // The shown value is the value in force, from a frame.
    commandRate(Number(rates.value));
    shownRate = undefined;
  };
  line.oninput = () => {
    dragged = true;
    seek(Number(line.value));
  };
  // A drag that ends where it began changes nothing.
  line.onpointerup = () => (dragged = false);
  line.onchange = () => {
    dragged = false;
    // The last place counts, however soon it follows the one before.
    soughtAt = Math.min(soughtAt, performance.now() - SEEK_INTERVAL);
    seek(Number(line.value));
  };

  const keys = {
    " ": toggle, ".": () => command("step", 1), h: hold,
    "[": () => changeRate(1 / 2), "]": () => changeRate(2),
    ArrowLeft: () => seekBy(-SEEK), ArrowRight: () => seekBy(SEEK),
  };
  /**
   * Keys that the focused element uses itself: the picture moves by arrows, buttons are pressed by space, lists have
   * theirs.
   */
  const usedBy = (target, key) =>
    target.closest("select, input:not([type=range]), dialog, #scrub") || (key === " " && target.closest("button")) ||
        (key.startsWith("Arrow") && target.closest("canvas"));
  addEventListener("keydown", (event) => {
    const { key, target } = event;
    if (bar.hidden || !keysConduct || event.ctrlKey || event.metaKey || (event.altKey && !"[]".includes(key))) return;
    const within = bar.contains(target);
    if (usedBy(target, key)) return within && event.stopPropagation();
    const act = keys[key.length === 1 ? key.toLowerCase() : key];
    if (!act && !(target === line && /^(Arrow|Home|End|Page)/.test(key))) return;
    if (!within && !keySwitch.on) {
      // Arrows move the picture or the page, and letters may be the picture's.
      if (!key.startsWith("Arrow") && !event.repeat) report(say("keysOff"));
      return;
    }
    // The picture's own keys do not act as well.
    event.stopPropagation();
    if (!act) return;
    event.preventDefault();
    if (!event.repeat || key.startsWith("Arrow")) act();
  }, { capture: true });
  setInterval(show, 100);
}
