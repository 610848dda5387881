// Keeps a page as it is on the server: takes the parts that have changed from the event stream, and says when it could not.
// Everything here is a help; the pages can be read without it.

const body = document.body;
const link = document.getElementById("link");
const notice = document.getElementById("notice");
const hall = body.classList.contains("hall");
/** Time without any event after which the connection counts as cut; the server says something every half second. */
const SILENCE_MS = 3000;
/** After a touch of the screen, tiles stay where they are for this long. */
const HOLD_MS = 30000;

body.classList.add("scripted");

/** Times of the server are of UTC; here they are of the viewer's zone, with UTC on hover. @param {ParentNode} root */
function localise(root) {
  for (const node of /** @type {NodeListOf<HTMLTimeElement>} */ (root.querySelectorAll("time[datetime]"))) {
    const at = new Date(node.dateTime);
    const told = node.textContent ?? "";
    if (node.title || isNaN(at.getTime())) continue;
    node.title = `${node.dateTime.replace("T", " ").replace("Z", "")} UTC`;
    const local = new Date(at.getTime() - at.getTimezoneOffset() * 60000).toISOString();
    // As exact as the server tells it: date and time, or time of day.
    node.textContent = told.includes("-") ? local.slice(0, told.length).replace("T", " ") : local.slice(11, 11 + told.length);
  }
}

localise(document);
const zone = document.getElementById("zone");
if (zone && new Date().getTimezoneOffset()) zone.textContent = "Times are of your zone, UTC on hover.";

/** Cards as the server told them last, and those out of sight that are to be shown when nothing is asked for any more. */
const told = new Map(), later = new Map();

/** Puts the part with this id in place of the present one. @param {string} id @param {string} html */
function put(id, html) {
  told.delete(id);
  later.delete(id);
  const template = document.createElement("template");
  template.innerHTML = html;
  if (template.content.firstElementChild) set(id, template.content.firstElementChild);
}

/** @param {string} id @param {Element} fresh */
function set(id, fresh) {
  localise(fresh);
  const old = document.getElementById(id);
  if (!old) {
    if (!fresh.classList.contains("tile")) return;
    document.getElementById("tiles")?.append(fresh);
    document.querySelector(".empty")?.remove();
    return;
  }
  // What a person has opened or is reading stays open, and the focus stays where it is.
  const open = [...old.querySelectorAll("details")].map((one) => one.open);
  fresh.querySelectorAll("details").forEach((one, index) => { if (index < open.length) one.open = open[index]; });
  const focused = [...old.querySelectorAll("a, button, summary, [tabindex]")].indexOf(/** @type {Element} */ (document.activeElement));
  if (!around(old, fresh)) old.replaceWith(fresh);
  if (focused >= 0) /** @type {HTMLElement[]} */ ([...fresh.querySelectorAll("a, button, summary, [tabindex]")])[focused]?.focus({ preventScroll: true });
  dispatchEvent(new Event("put"));
}

/** Puts what stands around a picture that a script draws: the picture itself takes the new data and stays where it is, under the
 * pointer that turns it. @param {Element} old @param {Element} fresh */
function around(old, fresh) {
  const kept = /** @type {HTMLElement | null} */ (old.querySelector(".scene:has(canvas)"));
  const next = /** @type {HTMLElement | null} */ (fresh.querySelector(".scene"));
  if (!kept || !next) return false;
  Object.assign(kept.dataset, next.dataset);
  for (const one of [...old.children]) if (one !== kept) one.remove();
  let behind = false;
  for (const one of [...fresh.children]) {
    if (one === next) behind = true;
    else if (behind) old.append(one);
    else old.insertBefore(one, kept);
  }
  return true;
}

/** Says something that stays until it is closed. @param {string} text */
function tell(text) {
  if (!notice) return;
  notice.textContent = text + " ";
  const close = document.createElement("button");
  close.type = "button";
  close.textContent = "Close";
  close.onclick = () => { notice.hidden = true; };
  notice.append(close);
  notice.hidden = false;
}

// --- order of the tiles ---------------------------------------------------------------------------------------------

/** @type {string[] | null} */
let wanted = null;
let held = 0;
const resort = document.getElementById("resort");

function isHeld() {
  const tiles = document.getElementById("tiles");
  if (body.classList.contains("wall")) return false;
  return matchMedia("(pointer: coarse)").matches || performance.now() < held || tiles?.matches(":hover") || tiles?.contains(document.activeElement);
}

/** Brings the tiles into the order of urgency: never under a finger or a pointer, except when asked. @param {boolean} asked */
function sort(asked) {
  const tiles = document.getElementById("tiles");
  if (!wanted || !tiles) return;
  for (const tile of [...tiles.children]) if (!wanted.includes(tile.id)) tile.remove();
  const present = [...tiles.children].map((tile) => tile.id);
  const target = wanted.filter((id) => present.includes(id));
  const differs = target.some((id, index) => id !== present[index]);
  if (differs && !asked && isHeld()) {
    if (resort) resort.hidden = false;
    return;
  }
  if (resort) resort.hidden = true;
  if (differs) tiles.append(...target.map((id) => /** @type {Node} */ (document.getElementById(id))));
}

if (hall) {
  addEventListener("pointerdown", () => { held = performance.now() + HOLD_MS; });
  document.getElementById("tiles")?.addEventListener("pointerleave", () => sort(false));
  resort?.addEventListener("click", () => sort(true));
}

// --- event stream ---------------------------------------------------------------------------------------------------

/** @type {EventSource | null} */
let source = null;
let heard = performance.now();
let cutSince = 0;
let seen = body.dataset.seen ?? "";

function follow() {
  const address = body.dataset.stream;
  if (!address) return;
  source?.close();
  source = new EventSource(address + (address.includes("?") ? "&" : "?") + "since=" + encodeURIComponent(seen));
  /** @param {string} name @param {(data: any) => void} take */
  const on = (name, take) => source?.addEventListener(name, (event) => {
    const { data, lastEventId } = /** @type {MessageEvent} */ (event);
    heard = performance.now();
    seen = lastEventId || seen;
    take(JSON.parse(data));
    alive();
  });
  on("part", ({ id, html }) => put(id, html));
  on("order", (order) => { wanted = order; setTimeout(() => sort(false), 0); });
  on("beat", () => {});
  on("gone", () => tell("This cell is not known any more: it left the bus a while ago."));
  on("restarted", () => location.reload());
  on("caught-up", caughtUp);
  source.onerror = () => { if (source?.readyState === EventSource.CLOSED) setTimeout(follow, 1000); };
}

/** @param {{events: number, kinds: string[], lost: number}} missed */
function caughtUp({ events, kinds, lost }) {
  if (!cutSince) return;
  const seconds = Math.round((performance.now() - cutSince) / 1000);
  const got = events ? `Caught up on ${kinds.join(", ")}.` : "Nothing happened meanwhile.";
  const gone = lost ? ` ${lost} older events are not held any more; what they led to is shown.` : "";
  tell(`The connection was cut for ${seconds} s. ${got}${gone}`);
}

function alive() {
  cutSince = 0;
  if (!link || link.textContent === "Live") return;
  link.textContent = "Live";
  link.className = "";
}

/** What is shown is not said to be live when it is not. */
function watch() {
  const silent = performance.now() - heard;
  if (silent < SILENCE_MS || !link || !source) return;
  if (!cutSince) cutSince = heard;
  link.className = "cut";
  link.textContent = `No connection for ${Math.round(silent / 1000)} s: what you see is old`;
  // A browser may keep a dead connection for minutes.
  if (silent > 3 * SILENCE_MS && Math.round(silent / 1000) % 5 === 0) follow();
}

if (body.dataset.stream) {
  follow();
  setInterval(watch, 1000);
}

// --- turning the part, and the timeline of a session ------------------------------------------------------------------

/** The address that is being fetched, and the one to fetch next: of those asked for meanwhile, the last. */
let fetched = "", next = "";
const STILL_MS = 150;
let still = 0;

/** Fetches an address of this page and takes its parts over. @param {string} address */
async function take(address) {
  next = address;
  clearTimeout(still);
  if (fetched) return;
  while (next) {
    [fetched, next] = [next, ""];
    const html = await fetch(fetched).then((answer) => answer.ok ? answer.text() : "", () => null);
    const at = fetched;
    fetched = "";
    if (html) show(new DOMParser().parseFromString(html, "text/html"), at);
    if (html === null) {
      next = "";
      setPlaying(false);
      tell("The dashboard does not answer: what you see is old.");
    }
  }
  still = setTimeout(() => {
    later.forEach((card, id) => set(id, card));
    later.clear();
    if (source?.readyState === EventSource.CLOSED) follow();
  }, STILL_MS);
}

/** Whether a part of the page is on the screen; the axes move what is drawn there. @param {string} id */
function inSight(id) {
  if (id === "axes") return true;
  const place = document.getElementById(id)?.getBoundingClientRect();
  return !place || (place.bottom >= 0 && place.top <= innerHeight);
}

/** @param {Document} fresh @param {string} address */
function show(fresh, address) {
  const cards = fresh.querySelectorAll(".cards > .card");
  const at = document.getElementById("at");
  if (at && (!cards.length || !document.querySelector(".cards"))) {
    localise(fresh);
    told.clear();
    later.clear();
    at.replaceWith(/** @type {Node} */ (fresh.getElementById("at")));
  } else for (const card of cards) {
    const html = card.outerHTML;
    if (told.get(card.id) === html && !later.has(card.id)) continue;
    told.set(card.id, html);
    later.delete(card.id);
    if (inSight(card.id)) set(card.id, card);
    else later.set(card.id, card);
  }
  for (const id of ["instant", "sums", "tiles", "count", "listed"]) {
    const node = fresh.getElementById(id);
    if (!node) continue;
    localise(node);
    document.getElementById(id)?.replaceWith(node);
  }
  // The links stay: one of them may be under a finger.
  const steps = document.querySelectorAll(".timeline .steps a");
  fresh.querySelectorAll(".timeline .steps a").forEach((one, index) => steps[index]?.setAttribute("href", one.getAttribute("href") ?? ""));
  history.replaceState(null, "", address);
  const stream = fresh.body.dataset.stream;
  if (stream && stream !== body.dataset.stream) {
    body.dataset.stream = stream;
    wanted = null;
    // Opened again when nothing is asked for any more.
    source?.close();
    heard = performance.now();
  }
}

// --- saving a chart ---------------------------------------------------------------------------------------------------

const STYLES = ["fill", "fill-opacity", "stroke", "stroke-width", "stroke-dasharray", "opacity", "font-family", "font-size", "font-weight"];

addEventListener("click", (event) => {
  const button = /** @type {HTMLElement | null} */ (/** @type {Element} */ (event.target).closest?.("[data-save]"));
  const chart = button?.closest("figure")?.querySelector("svg");
  if (!button || !chart) return;
  const copy = /** @type {SVGSVGElement} */ (chart.cloneNode(true));
  // What the style sheet gives goes with it.
  const copies = [copy, ...copy.querySelectorAll("*")];
  [chart, ...chart.querySelectorAll("*")].forEach((one, index) => {
    const style = getComputedStyle(one);
    for (const name of STYLES) copies[index].setAttribute(name, style.getPropertyValue(name));
  });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.style.background = getComputedStyle(document.documentElement).getPropertyValue("--card");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([new XMLSerializer().serializeToString(copy)], { type: "image/svg+xml" }));
  link.download = `${button.dataset.save}.svg`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
});

// --- choosing machines ------------------------------------------------------------------------------------------------

const choose = /** @type {HTMLFormElement | null} */ (document.getElementById("choose"));
choose?.addEventListener("input", () => {
  const address = new URLSearchParams(/** @type {any} */ (new FormData(choose)));
  for (const [name, value] of [...address]) if (!value && name !== "dense") address.delete(name);
  take(`${new URL(choose.action).pathname}${address.size ? "?" : ""}${address}`);
});

/** Recordings that the server had no time to read are asked for until none is left. */
async function readOn() {
  if (!document.querySelector("#listed[data-unread]")) return;
  if (!fetched) await take(location.pathname + location.search);
  setTimeout(readOn, 500);
}
setTimeout(readOn, 500);
choose?.addEventListener("submit", (event) => { event.preventDefault(); });

addEventListener("click", (event) => {
  const target = /** @type {Element} */ (event.target).closest?.(".turn a, .timeline .steps a");
  if (!target || event.ctrlKey || event.metaKey || event.shiftKey) return;
  event.preventDefault();
  const address = /** @type {HTMLAnchorElement} */ (target).getAttribute("href") ?? "";
  const time = new URL(address, location.href).searchParams.get("t");
  if (time && target.closest(".timeline")) moveTo(Number(time));
  else take(address.replace(/#.*/, ""));
});

addEventListener("keydown", (event) => {
  if (!document.getElementById("part")?.contains(document.activeElement)) return;
  const button = document.querySelector(`.turn [data-key="${CSS.escape(event.key)}"]`);
  if (!button) return;
  event.preventDefault();
  /** @type {HTMLElement} */ (button).click();
});

const slider = /** @type {HTMLInputElement | null} */ (document.getElementById("t"));
const play = document.getElementById("play");
/** While it plays: the instant on the timeline, s, and when that was. */
let played = { at: 0, when: 0 }, playing = false;

function scrub() {
  const address = new URL(location.href);
  address.searchParams.set("t", Number(slider?.value).toFixed(2));
  take(address.pathname + address.search);
}

/** @param {number} to s */
function moveTo(to) {
  if (!slider) return;
  slider.value = String(to);
  played = { at: Number(slider.value), when: performance.now() };
  scrub();
}

/** @param {boolean} on */
function setPlaying(on) {
  if (!slider || !play) return;
  playing = on;
  play.textContent = on ? "Pause" : "Play";
  // From the end it plays anew.
  played = { at: on && Number(slider.value) >= Number(slider.max) ? 0 : Number(slider.value), when: performance.now() };
  if (on) requestAnimationFrame(goOn);
}

/** @param {number} now */
function goOn(now) {
  if (!playing || !slider) return;
  const speed = Number(/** @type {HTMLSelectElement | null} */ (document.getElementById("speed"))?.value ?? 1);
  const at = played.at + Math.max(0, now - played.when) / 1000 * speed;
  played = { at, when: Math.max(now, played.when) };
  slider.value = String(at);
  const ended = at >= Number(slider.max);
  if (ended || !fetched) scrub();
  if (ended) setPlaying(false);
  else requestAnimationFrame(goOn);
}

slider?.addEventListener("input", () => moveTo(Number(slider.value)));
for (const one of document.querySelectorAll(".timeline [hidden]")) one.removeAttribute("hidden");
play?.addEventListener("click", () => setPlaying(!playing));
addEventListener("keydown", (event) => {
  const from = /** @type {Element} */ (event.target);
  if (!slider || event.ctrlKey || event.metaKey || event.altKey || from.closest("#part, .scroll, select, input:not(#t)")) return;
  const step = event.shiftKey ? 10 : 1, at = Number(slider.value);
  if (event.key === " " && !event.repeat && !from.closest("button, summary, a")) setPlaying(!playing);
  else if (event.key === "ArrowLeft") moveTo(at - step);
  else if (event.key === "ArrowRight") moveTo(at + step);
  else return;
  event.preventDefault();
});
