// Acts of an operator. The key is made and kept by this browser (WebCrypto, Ed25519, not extractable, in IndexedDB); what is signed
// is the statement of docs/approvals.md, made here of what the dashboard offers and of what was on the screen.

const NAME = /^(?!\.)[\p{L}\p{N}._-]{1,64}$/u;
const LONGEST = 4000;

// --- the key of this device -------------------------------------------------------------------------------------------

/** @template T @param {IDBRequest<T>} request @returns {Promise<T>} */
const done = (request) => new Promise((resolve, reject) => {
  request.onsuccess = () => resolve(request.result);
  request.onerror = () => reject(request.error);
});

/** @param {IDBTransactionMode} mode @param {(store: IDBObjectStore) => IDBRequest} work */
async function store(mode, work) {
  const open = indexedDB.open("probecell", 1);
  open.onupgradeneeded = () => open.result.createObjectStore("keys");
  const base = await done(open);
  try {
    return await done(work(base.transaction("keys", mode).objectStore("keys")));
  } finally {
    base.close();
  }
}

/** @typedef {{name: string, key: CryptoKey, text: string}} Own */
/** @returns {Promise<Own | undefined>} */
const own = () => store("readonly", (keys) => keys.get("operator"));

/** @param {Uint8Array} bytes */
const digits = (bytes) => [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
/** @param {string} text */
const bytes = (text) => Uint8Array.from(text.match(/../g) ?? [], (pair) => Number.parseInt(pair, 16));

/** Makes the key of this device. @param {string} name */
async function make(name) {
  const pair = /** @type {CryptoKeyPair} */ (await crypto.subtle.generateKey({ name: "Ed25519" }, false, ["sign", "verify"]));
  const text = digits(new Uint8Array(await crypto.subtle.exportKey("raw", pair.publicKey)));
  await store("readwrite", (keys) => keys.put({ name, key: pair.privateKey, text }, "operator"));
}

// --- what is signed -----------------------------------------------------------------------------------------------------

/** The statement of docs/approvals.md. @param {any} offer @param {string} by @param {string} shown */
function statement(offer, by, shown) {
  const text = new TextEncoder();
  const instant = new DataView(new ArrayBuffer(8));
  instant.setBigInt64(0, BigInt(offer.at_ns), true);
  const fields = [
    text.encode("probecell act 1"), bytes(offer.cell_key), text.encode(offer.kind), text.encode(by),
    new Uint8Array(instant.buffer), text.encode(shown), bytes(offer.subject),
  ];
  const whole = new Uint8Array(fields.reduce((length, field) => length + 4 + field.length, 0));
  let at = 0;
  for (const field of fields) {
    new DataView(whole.buffer).setUint32(at, field.length, true);
    whole.set(field, at + 4);
    at += 4 + field.length;
  }
  return whole;
}

/** @param {string} address @param {object} content */
async function post(address, content) {
  const { token } = await (await fetch("/act/token")).json();
  const headers = { "content-type": "application/json", "x-act-token": token };
  const answer = await fetch(address, { method: "POST", headers, body: JSON.stringify(content) });
  const told = await answer.json();
  if (!answer.ok) throw new Error(told.text);
  return told;
}

/** @param {any} offer @param {string} shown */
async function send(offer, shown) {
  const key = await own();
  if (!key) throw new Error("this device holds no key");
  const signature = new Uint8Array(await crypto.subtle.sign("Ed25519", key.key, statement(offer, key.name, shown)));
  return post("/act", { token: offer.token, operator: key.name, shown, signature: digits(signature) });
}

// --- the dialogue -------------------------------------------------------------------------------------------------------

/** @param {string} kind @param {Record<string, any>} [set] @param {(Node | string)[]} [inside] */
function node(kind, set = {}, inside = []) {
  const one = Object.assign(document.createElement(kind), set);
  one.append(...inside);
  return one;
}

/** Shows a question with buttons; gives the value of the one pressed, empty when it was closed.
 * @param {HTMLDialogElement} dialog @param {string} title @param {Node[]} inside @param {[string, string][]} buttons @returns {Promise<string>} */
function ask(dialog, title, inside, buttons) {
  const form = node("form", { method: "dialog" }, [
    node("h2", { id: "deed-title", textContent: title }), ...inside,
    node("p", { className: "deeds" }, buttons.map(([value, label]) => node("button", { value, textContent: label }))),
  ]);
  dialog.replaceChildren(form);
  dialog.returnValue = "";
  if (!dialog.open) dialog.showModal();
  return new Promise((resolve) => { dialog.onclose = () => resolve(dialog.returnValue); });
}

/** What stands in an element, as text of one line. @param {string} id */
const seen = (id) => (document.getElementById(id)?.innerText ?? "").replace(/\s+/g, " ").trim();

/** @param {HTMLButtonElement} button */
async function act(button) {
  const { act, cell, subject = "", ask: question } = button.dataset;
  const label = button.textContent ?? "";
  const dialog = /** @type {HTMLDialogElement} */ (node("dialog", { className: "deed" }));
  dialog.setAttribute("aria-labelledby", "deed-title");
  document.body.append(dialog);
  const told = node("p", { id: "deed-answer" });
  try {
    let on = subject;
    if (question) {
      const field = /** @type {HTMLInputElement} */ (node("input", { id: "deed-subject", required: true, autocomplete: "off" }));
      const fields = [node("p", {}, [node("label", { htmlFor: "deed-subject", textContent: question + " " }), field])];
      if (await ask(dialog, label, fields, [["go", "Next"]]) !== "go") return;
      on = field.value;
    }
    const offer = await post("/act/offer", { cell, act, subject: on });
    let shown = `${offer.summary.join("\n")}\nOn screen: ${seen("state")}`;
    // Nobody is asked twice whether a machine is to stop.
    if (act !== "stop") {
      const lines = offer.summary.map((/** @type {string} */ line) => node("p", { textContent: line }));
      if (await ask(dialog, label, lines, [["go", "Sign and send"], ["", "Cancel"]]) !== "go") return;
    }
    shown = shown.slice(0, LONGEST);
    while (new TextEncoder().encode(shown).length > 4096) shown = shown.slice(0, -100);
    const waiting = ask(dialog, label, [node("p", { textContent: "Sent; the cell answers." })], []);
    waiting.catch(() => {});
    const answer = await send(offer, shown);
    told.textContent = answer.accepted ? `Accepted: ${answer.text}` : `Refused: ${answer.text}`;
  } catch (error) {
    told.textContent = `Refused: ${/** @type {Error} */ (error).message}`;
  } finally {
    if (told.textContent) await ask(dialog, label, [told], [["", "Close"]]);
    dialog.remove();
  }
}

addEventListener("click", (event) => {
  const button = /** @type {Element} */ (event.target).closest?.("[data-act]");
  if (button) act(/** @type {HTMLButtonElement} */ (button));
});

// --- what this device can do ----------------------------------------------------------------------------------------------

/** The page of the key. @param {Own | undefined} key */
function tell(key) {
  const state = document.getElementById("key-state");
  const form = /** @type {HTMLFormElement | null} */ (document.getElementById("key-form"));
  const command = document.getElementById("key-command");
  const forget = /** @type {HTMLButtonElement | null} */ (document.getElementById("key-forget"));
  if (!state || !form || !command || !forget) return;
  if (!globalThis.isSecureContext || !globalThis.crypto?.subtle) {
    state.textContent = "This device only reads: browsers sign on pages that came over TLS, or from the computer itself (127.0.0.1). Reach the dashboard by https through the shop's proxy to sign here.";
    return;
  }
  form.hidden = Boolean(key);
  forget.hidden = command.hidden = !key;
  state.textContent = key ? `This device signs for ${key.name}. Each cell registers the key once, and withdraws it by name:` : "This device holds no key: it only reads.";
  command.textContent = key ? `probecell key add ${key.name} ${key.text} --cell CELL.toml` : "";
  form.onsubmit = async (event) => {
    event.preventDefault();
    const name = /** @type {HTMLInputElement} */ (document.getElementById("key-name")).value.trim();
    if (!NAME.test(name)) {
      state.textContent = "A name has up to 64 letters, digits, dots, dashes and underscores, no dot first.";
      return;
    }
    try {
      await make(name);
    } catch (error) {
      state.textContent = `This browser cannot make an Ed25519 key: ${/** @type {Error} */ (error).message}`;
      return;
    }
    await show();
  };
  forget.onclick = async () => {
    await store("readwrite", (keys) => keys.delete("operator"));
    await show();
  };
}

async function show() {
  const key = globalThis.isSecureContext && globalThis.crypto?.subtle ? await own() : undefined;
  document.body.classList.toggle("signs", Boolean(key));
  tell(key);
}

show();
