// Every word of the page, in English and in Chinese, and the sentences about alerts.
//
// English sentences about alerts and refused commands come from the server, as those of `run`, `watch` and `control`.
// The Chinese sentences are made here from the same numbers and names.

const WORDS = {
  title: ["{scene} ({publisher}): stage picture", "{scene}（{publisher}）：舞台画面"],
  titleSeveral: ["{publishers}: stage picture", "{publishers}：舞台画面"],
  stage: ["Bench dragon: stage picture", "板凳龙：舞台画面"],
  canvas: ["The stage from above. Arrow keys move the picture, plus and minus zoom, F follows the head, 0 shows " +
      "all, question mark lists the keys.", "从上方看的舞台。方向键移动画面，加减号缩放，F 跟随龙头，0 显示全部，问号列出按键。"],
  stageRole: ["stage", "舞台"],
  dragons: ["All dragons", "全部舞龙队"],
  clearance: ["Clearance", "间距"],
  speed: ["Speed, m/s", "速度（m/s）"],
  bench: ["Bench", "板凳"],
  pick: ["Click a bench, or type its number.", "点击一节板凳，或输入其编号。"],
  follow: ["Follow head", "跟随龙头"],
  followBench: ["Follow bench {bench}", "跟随第 {bench} 节"],
  whole: ["Show all", "显示全部"],
  nearer: ["Zoom in", "放大"],
  farther: ["Zoom out", "缩小"],
  theme: ["Light / dark", "浅色／深色"],
  full: ["Full screen", "全屏"],
  sound: ["Sound", "声音"],
  keys: ["Keys", "按键"],
  close: ["Close", "关闭"],
  key_arrows: ["move the picture", "移动画面"],
  key_zoom: ["zoom", "缩放"],
  key_0: ["show all", "显示全部"],
  key_f: ["follow the head, or the chosen bench", "跟随龙头或所选板凳"],
  key_camera: ["take a kept camera", "切换到已保存的视角"],
  key_keep: ["keep this camera, on this browser", "在本浏览器中保存此视角"],
  key_t: ["light or dark", "浅色或深色"],
  key_p: ["full screen", "全屏"],
  key_s: ["sound: a tick at 3, 2, 1, a gong at the event", "声音：倒数 3、2、1 时滴答，事件发生时锣响"],
  key_escape: ["back to the live picture; or choose no bench", "回到实时画面；或取消选择"],
  key_i: ["say where the head is, its speed and the clearance", "读出龙头位置、速度和间距"],
  key_m: ["measure: two clicks, or Enter at the middle of the picture", "测距：点击两处，或按 Enter 取画面中点"],
  key_help: ["this list", "本列表"],
  key_space: ["play or pause", "播放或暂停"],
  key_seek: ["5 s back or on", "后退或前进 5 秒"],
  key_rate: ["half or twice the speed", "速度减半或加倍"],
  key_step: ["one step, while paused", "单步（暂停时）"],
  key_h: ["hold all, or release", "全部锁定或解除"],
  keysOn: ["Keys act everywhere. Off: letters only while the picture has the focus, and keys that conduct only in " +
      "the bar.", "按键处处有效。关闭时：字母键仅在画面获得焦点时有效，操控键仅在操控栏内有效。"],
  keysOff: ["Keys conduct only in this bar: press Tab until it has the focus, or switch them on under “?”.",
      "按键仅在此栏内有效：请按 Tab 键移入此栏，或在“?”中打开。"],
  measure: ["Measure", "测距"],
  measureFirst: ["Measure: click two places, or press Enter for the middle of the picture.", "测距：点击两处，或按 Enter 取画面中点。"],
  measured: ["{metres} m from ({ax}, {ay}) to ({bx}, {by})", "({ax}, {ay}) 至 ({bx}, {by})：{metres} m"],
  scrubLine: ["Look at another time: the show continues, and gets no command", "查看其他时刻：演出继续，不受影响"],
  notLive: ["t = {time} s, not live", "t = {time} s，非实时"],
  notLiveYet: ["t = {time} s, not live: computing", "t = {time} s，非实时：计算中"],
  liveAt: ["live, {time} s", "实时，{time} 秒"],
  live: ["Live", "实时"],
  ghostBefore: ["{seconds} s before", "{seconds} 秒前"],
  ghostAfter: ["{seconds} s after", "{seconds} 秒后"],
  ghostEvent: ["{kind} at {time} s", "{kind}，{time} 秒"],
  curve: ["Clearance over the whole show, from 1 mm to 1 m", "整场演出的间距，1 毫米至 1 米"],
  leastClearance: ["least clearance {metres} m at {time} s, {benches}", "最小间距 {metres} m，{time} 秒，{benches}"],
  chaseTracker: ["{source} tracker {tracker}", "{source} 追踪点 {tracker}"],
  chaseMs: [", {ms} ms", "，{ms} 毫秒"],
  chaseOff: [", {metres} m off the path", "，偏离路径 {metres} 米"],
  chaseDied: ["The chase has died: the show stays at its last rate.", "跟随程序已终止：演出保持最后的倍速。"],
  chase_silent: ["", "没有信号"],
  chase_locking: ["", "正在锁定"],
  chase_locked: ["", "已锁定"],
  chase_freewheeling: ["", "自由运行"],
  chase_standing: ["", "时码静止：演出停在此处"],
  chase_backward: ["", "时码倒走：演出已暂停"],
  chase_lost: ["", "信号丢失：演出已暂停"],
  chase_held: ["", "等待：演出已锁定"],
  chase_paused: ["", "等待：演出被暂停，继续后恢复"],
  chase_sought: ["", "等待：演出被跳转，暂停并继续后恢复"],
  distance: ["{metres}\u00a0m", "{metres}\u00a0m"],
  distanceTo: ["{metres} to {to}", "距{to} {metres}"],
  distanceBeyond: ["{to}, {metres} beyond its keep-out", "{to}，超出警戒距离 {metres}"],
  distanceOf: ["{of}: {distance}", "{of}：{distance}"],
  spokenNow: ["Head at {x}, {y} metres. Speed {speed}. Clearance {clearance}.",
      "龙头位于 {x}、{y} 米。速度 {speed}。间距 {clearance}。"],

  // States and kinds of events.
  moving: ["moving", "行进中"],
  approaching: ["approaching", "即将发生"],
  contact: ["contact", "碰撞"],
  stall: ["stall", "死点"],
  lock: ["lock", "锁死"],
  path_end: ["path end", "路径终点"],
  obstacle: ["obstacle", "障碍物"],
  unknown: ["unknown", "未知"],

  // Proofs of certificates.
  proofs: ["Proved by a certificate", "由证书证明"],
  provedBetween: ["{kind}: proved, first at {lo} to {hi} s{beyond}", "{kind}：已证明，首次在 {lo} 至 {hi} 秒{beyond}"],
  provedNone: ["{kind}: proved, none", "{kind}：已证明，不会发生"],
  provedNoneBefore: ["{kind}: proved, none before {lo} s; the lock is later", "{kind}：已证明，{lo} 秒之前不会发生；锁死在此之后"],
  provedUpTo: ["{kind}: proved up to {lo} s, none so far; then undecided", "{kind}：已证明至 {lo} 秒，此前不会发生；之后未定"],
  beyondShow: [", after the show", "（演出之后）"],

  // Benches.
  one: ["bench {number}", "第 {number} 节板凳"],
  head: ["HEAD", "龙头"],
  tail: ["TAIL", "龙尾"],
  body: ["body", "龙身"],
  headBench: ["HEAD (bench 1)", "龙头（第 1 节）"],
  numbers: ["benches {a} and {b}", "第 {a} 与第 {b} 节板凳"],
  number: ["bench {a}", "第 {a} 节板凳"],
  ofDragon: ["{words} of {dragon}", "{dragon}的{words}"],
  ofThem: [" of {dragon}", "，{dragon}"],
  both: ["{a} and {b}", "{a}与{b}"],
  theObstacle: ["the {name}", "障碍物“{name}”"],
  stands: ["stands", "静止"],
  detail: ["Bench {number} of {count}{of}{name}: front handle at ({x}, {y}) m, {speed}, heading {degrees}°",
      "第 {number} 节板凳（共 {count} 节{of}{name}）：前把手位于 ({x}, {y}) m，{speed}，航向 {degrees}°"],
  theHead: [", the head", "，龙头"],
  theTail: [", the tail", "，龙尾"],
  perSecond: ["{speed} m/s", "{speed} m/s"],
  speedNotSent: ["speed not sent", "未发送速度"],
  notSent: ["not sent", "未发送"],
  notComputed: ["not computed", "未计算"],
  overlap: ["{metres} m overlap", "重叠 {metres} m"],
  rest: ["at rest", "静止"],

  // Time.
  next: ["next: {kind} in", "下一事件：{kind}，还有"],
  in: ["{kind} in", "距{kind}还有"],
  s: ["s", "秒"],
  min: ["min", "分"],
  h: ["h", "时"],
  time: ["t = {time} s{rate}", "t = {time} s{rate}"],
  rate: [" (× {rate})", "（× {rate}）"],
  frames: ["{rate} frames/s{behind}", "{rate} 帧/秒{behind}"],
  behind: [", {ms} ms behind the publisher", "，比发布端晚 {ms} 毫秒"],
  seconds: ["{seconds} seconds", "{seconds} 秒"],

  // On the picture.
  coming: ["{kind}: {benches}, here, in {time}", "{kind}：{benches}，在此处，还有 {time}"],
  comingStill: ["{kind}: {benches}, here", "{kind}：{benches}，在此处"],
  overlapNow: ["{benches} overlap by {metres} m", "{benches}重叠 {metres} m"],
  touchNow: ["{benches} touch", "{benches}相触"],
  lostPublisher: ["No publisher. The picture is from t = {time} s.", "没有发布端。画面停在 t = {time} s。"],
  lostServer: ["No server. The picture is from t = {time} s.", "没有服务器。画面停在 t = {time} s。"],
  silent: ["No frames for {seconds} s. The picture is from t = {time} s.", "已有 {seconds} 秒没有新帧。画面停在 t = {time} s。"],

  // The transport bar, and the commands and playback states in answers.
  conduct: ["Conduct the show", "操控演出"],
  toggleKey: ["Space", "空格键"],
  stepKey: [". (while paused)", ".（暂停时）"],
  play: ["Play", "播放"],
  pause: ["Pause", "暂停"],
  resume: ["Play", "播放"],
  step: ["Step", "单步"],
  restart: ["Restart", "从头开始"],
  seek: ["Seek", "跳转"],
  go: ["Go", "继续"],
  hold: ["Hold", "锁定"],
  release: ["Release", "解除锁定"],
  heldRelease: ["HELD: release", "已锁定：解除"],
  rateInForce: ["Speed", "倍速"],
  rateUnknown: ["The speed is not known until the show plays.", "演出播放后才知道倍速。"],
  timeLine: ["Time of the show", "演出时间"],
  showTime: ["{time} s", "{time} 秒"],
  eventMark: ["{kind}, {time} s{proved}", "{kind}，{time} 秒{proved}"],
  markProved: [", proved", "，已证明"],
  cueMark: ["cue \"{name}\", {time} s{waits}", "提示点“{name}”，{time} 秒{waits}"],
  waitsThere: [", waits there", "，在此等待"],
  between: ["; ", "；"],
  noAnswer: ["The connection broke: no answer came.", "连接中断：未收到答复。"],
  nothingSent: ["The server is not there: nothing was sent.", "服务器不在：命令未发送。"],
  playing: ["playing", "播放中"],
  paused: ["paused", "已暂停"],
  held: ["held", "已锁定"],
  ended: ["ended", "已结束"],
  refused: ["", "{command}被拒绝：演出{playback}。"],
  out_of_range: ["", "{command}被拒绝：数值超出范围。"],
  too_many: ["", "{command}被拒绝：等待中的命令过多。"],
  not_understood: ["", "发布端不理解命令“{command}”。"],
  notAnswered: ["", "发布端未答复：{reason}"],

  conductWhom: ["Dragon", "舞龙队"],
  all: ["All", "全部"],
  refusedBy: ["{name}: {sentence}", "{name}：{sentence}"],

  // The transport state in the header: its word, its detail, and its sentence for a screen reader.
  playingWord: ["PLAYING", "播放中"],
  pausedWord: ["PAUSED", "已暂停"],
  heldWord: ["HELD", "已锁定"],
  goWord: ["GO?", "等待继续"],
  endedWord: ["ENDED", "已结束"],
  noPublisher: ["NO PUBLISHER", "没有发布端"],
  noServer: ["NO SERVER", "没有服务器"],
  noFrames: ["NO FRAMES", "没有新帧"],
  noStageYet: ["NO STAGE", "没有舞台数据"],
  otherVersion: ["OTHER VERSION", "版本不符"],
  sinceThen: ["for {passed}", "已 {passed}"],
  heldTouch: ["for {passed} · release: the red button", "已 {passed} · 按红色按钮解除"],
  heldFor: ["for {passed} · release: H", "已 {passed} · 按 H 解除"],
  goDetail: ["{cue} · waits {passed}", "{cue} · 已等待 {passed}"],
  endedAt: ["at {time} s", "停于 {time} 秒"],
  endedAgain: ["at {time} s · again in {seconds} s", "停于 {time} 秒 · {seconds} 秒后重新开始"],
  times: ["× {rate}", "× {rate}"],
  cueNamed: ["cue {number} · {name}", "提示点 {number} · {name}"],
  pictureFrom: ["picture from t = {time} s, {ago} ago", "画面停在 t = {time} 秒，{ago} 之前"],
  playingSpoken: ["Playing.", "播放中。"],
  pausedSpoken: ["Paused.", "已暂停。"],
  heldSpoken: ["Held.", "已锁定。"],
  goSpoken: ["Waiting for go: {cue}.", "等待继续：{cue}。"],
  endedSpoken: ["Ended.", "已结束。"],
  eventAhead: ["{kind} ahead", "{kind}：尚有"],

  locked: ["locked", "已锁定画面"],
  notToScale: ["Not to scale above the boards.", "板凳以上的部分不按比例。"],
  still: ["A still, renewed every {seconds} s: this computer draws {rate} pictures/s. For a film: " +
      "benches/stage_picture.py film.", "静态画面，每 {seconds} 秒更新：本机每秒只能绘制 {rate} 幅。制作影片：benches/stage_picture.py film。"],
  cameraKept: ["Camera {number} kept", "已保存视角 {number}"],
  cameraTaken: ["Camera {number}", "视角 {number}"],
  cameraEmpty: ["Camera {number} is empty: Shift+{number} keeps this one", "视角 {number} 为空：Shift+{number} 保存当前视角"],
  cameraUnkept: ["This browser keeps no cameras", "本浏览器无法保存视角"],

  // The state of the page, spoken once.
  server: ["waiting for the server", "等待服务器"],
  publisher: ["waiting for a publisher", "等待发布端"],
  runningHere: ["running here: {names}", "本机正在运行：{names}"],
  startOne: ["start it with: bench-dragon run --name {name}", "启动命令：bench-dragon run --name {name}"],
  noStage: ["waiting for the stage", "等待舞台数据"],
  version: ["this page is for another version of the server: load it again", "本页面与服务器版本不符：请重新载入"],
  noFramesNow: ["no frames", "没有新帧"],
  dragonMoves: ["The dragon moves.", "龙在行进。"],
  clearAgain: ["Clear again.", "警报解除。"],
  address: ["“{words}” after # is not understood.", "无法理解 # 之后的“{words}”。"],
};

let language = 0;

/** Sets the language by its tag: Chinese, or else English. */
export function setLanguage(name) {
  language = /^zh\b/i.test(name) ? 1 : 0;
  document.documentElement.lang = language ? "zh-Hans" : "en";
}

/**
 * Returns the words of a key in the page's language, with the values in braces filled in. An unknown key is returned.
 */
export function say(key, values = {}) {
  const words = WORDS[key]?.[language] ?? key;
  return words.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "");
}

/** Sets the words of elements with `data-word`, `data-label`, `data-role` or `data-title` in the page's language. */
export function translate(root) {
  for (const one of root.querySelectorAll("[data-word]")) one.textContent = say(one.dataset.word);
  for (const one of root.querySelectorAll("[data-title]")) one.title = say(one.dataset.title);
  for (const one of root.querySelectorAll("[data-role]")) one.setAttribute("aria-roledescription",
      say(one.dataset.role));
  for (const one of root.querySelectorAll("[data-label]")) one.setAttribute("aria-label", say(one.dataset.label));
}

/** Returns the reason of a refusal. English sentences are the server's, also for a command that was not sent. */
export function answerTo({ code, command, playback, sentence }) {
  if (language === 0) return `${capital(sentence)}.`;
  if (!WORDS[code]) return say("notAnswered", { reason: sentence });
  return say(code, { command: command === "rate" ? say("rateInForce") : say(command), playback: say(playback) });
}

/** Returns English words with a capital letter; others as they are. */
export const capital = (words) => (words && language === 0 ? words[0].toUpperCase() + words.slice(1) : words);

/** Returns seconds in a form readable from afar: a number and its unit. */
export function remaining(seconds) {
  if (seconds < 100) return [seconds.toFixed(1), say("s")];
  const whole = Math.floor(seconds), pad = (number) => String(number).padStart(2, "0");
  const hours = Math.floor(whole / 3600), minutes = Math.floor(whole / 60) % 60;
  return hours ? [`${hours}:${pad(minutes)}:${pad(whole % 60)}`, say("h")] : [`${minutes}:${pad(whole % 60)}`,
      say("min")];
}

/** Returns seconds as minutes and seconds. */
export function minutes(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/** One or two benches (from 0) by their numbers from 1. */
function benchesOf(pair) {
  const [a, b] = pair.map((bench) => bench + 1);
  return b === undefined ? say("number", { a }) : say("numbers", { a, b });
}

/** Returns seconds to the nanosecond, rounded up or down by `step`: shown bounds enclose the exact ones. */
function outward(seconds, step) {
  const near = Number(seconds.toFixed(9)), isInside = step > 0 ? near < seconds : near > seconds;
  return (isInside ? near + step : near).toFixed(9);
}

/**
 * Returns the proof of an event, in a show that ends at `showEnd`. `text` is empty for an unknown event, and `canCome`
 * is true if the show reaches the event.
 */
export function proofOf({ event, status, time_lo, time_hi, obstacle }, showEnd) {
  const number = obstacle === undefined ? "" : ` ${obstacle + 1}`;
  const kind = capital(say(event)) + number, lo = time_lo === null ? null : outward(time_lo, -1e-9);
  const isBeyond = lo !== null && time_lo > showEnd;
  if (status === "proved") {
    const beyond = isBeyond ? say("beyondShow") : "";
    return { text: say("provedBetween", { kind, lo, hi: outward(time_hi, 1e-9), beyond }), canCome: !isBeyond };
  }
  if (status === "undecided") return { text: say("provedUpTo", { kind, lo }), canCome: true };
  // Without an end of the path the proof only states that the lock comes first.
  if (status === "none") return { text: lo === null ? say("provedNone", { kind }) : say("provedNoneBefore",
      { kind, lo }), canCome: event !== "path_end" };
  return { text: "", canCome: false };
}

const SOURCES = { artnet: "ArtTimeCode", mtc: "MTC", ltc: "LTC", psn: "PSN" };

/** Returns the status of a chase as a sentence. The English one is the server's. */
export function chaseOf({ source, state, timecode, tracker, error, distance, sentence }) {
  const words = WORDS[`chase_${state}`]?.[1];
  if (language === 0 || !words) return sentence;
  const title = SOURCES[source] ?? source, subject = timecode ? `${title} ${timecode}` : tracker === null ? title
      : say("chaseTracker", { source: title, tracker });
  const isAtWork = error !== null && ["locked", "freewheeling"].includes(state);
  const ms = isAtWork ? say("chaseMs", { ms: (1000 * error).toFixed(1) }) : "";
  return `${subject} ${words}${ms}${distance === null ? "" : say("chaseOff", { metres: distance.toFixed(2) })}`;
}

/** A bench's name on the picture. */
export const nameOf = (bench) => (bench === 0 ? say("headBench") : say("one", { number: bench + 1 }));

/**
 * Returns the name of a bench, by its number through all handles of a stage, or of an obstacle, whose numbers follow
 * the handles. `naming` names a bench by its number within its dragon, from 0.
 */
export function benchIn({ dragons, obstacles }, number, naming = nameOf) {
  const owner = dragons.find(({ first_handle, benches }) => number >= first_handle && number <= first_handle + benches);
  const { first_handle, benches } = dragons.at(-1), after = number - first_handle - benches - 1;
  if (!owner) return say("theObstacle", { name: obstacles[after]?.name ?? after + 1 });
  const name = naming(number - owner.first_handle, owner.benches);
  return dragons.length === 1 ? name : say("ofDragon", { words: name, dragon: owner.name });
}

/** Returns one or two benches or obstacles, by their numbers as in `benchIn`. */
export function benchesIn(stage, pair) {
  const { dragons: [first], dragons: { length } } = stage;
  if (length === 1 && pair.every((number) => number < first.benches)) return benchesOf(pair);
  const [a, b] = pair.map((number) => benchIn(stage, number, (bench) => benchesOf([bench])));
  return b === undefined ? a : say("both", { a, b });
}

/** Returns the sentence of an alert or a state; empty for an alert that the frames have not reached, or have left. */
export function sentenceOf(state, alert, stage) {
  if (language === 0 || !alert && !state.sentence) {
    if (state.sentence) return `${capital(state.sentence)}.`;
    return state.severity === "ok" || alert?.level !== state.name ? "" : `${capital(alert.sentence)}.`;
  }
  if (state.sentence) return stage.dragons.length > 1 ? "所有龙头都已到达各自路径的终点。" : "龙头已到达路径终点。";
  if (state.severity === "ok" || alert.level !== state.name) return "";
  const ends = (bench, count) => (bench === 0 ? "（龙头）" : bench === count - 1 ? "（龙尾）" : "");
  const name = (number) => benchIn(stage, number, (bench, count) => `第 ${bench + 1} 节板凳${ends(bench, count)}`);
  const both = (...pair) => pair.filter((number) => number !== null).map(name).join("与");
  const event = both(alert.event_bench_a, alert.event_bench_b), place = alert.event_x === null ? ""
      : `(${alert.event_x.toFixed(3)},\u00a0${alert.event_y.toFixed(3)})\u00a0m`;
  if (state.happened) {
    const at = `t\u00a0=\u00a0${alert.event_time?.toFixed(6)}\u00a0s`;
    if (alert.event === "obstacle") return `${event}于 ${place} 处相遇，${at}（编号从 1 起）。`;
    if (alert.event === "contact") return `${event}于 ${place} 处相触，${at}（编号从 1 起）。`;
    if (alert.event === "stall") return `${event}到达死点，${at}：自 ${place} 处的把手起，其后的队伍被向后推（编号从 1 起）。`;
    return `${event}锁死，其后把手位于 ${place}，${at}：无法继续行进（编号从 1 起）。`;
  }
  const coming = alert.event ? `${say(alert.event)}：${event}，位于 ${place}` : "前方没有碰撞、死点或锁死";
  const now = alert.bench_a === null ? "" : `；此刻最近的是${both(alert.bench_a, alert.bench_b)}`;
  return `${coming}${now}（编号从 1 起）。`;
}
