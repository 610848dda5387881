// The machine and its part in three dimensions, moved by the axes, with touches as they come: in place of the sketch, where the
// browser draws with WebGL. All that is drawn stands in data of the page; the library is loaded only then.

/** Colours of deviations, from the largest negative one to the largest positive one: told apart by eyes of every kind. */
const HEAT = [0x2166ac, 0x4393c3, 0x92c5de, 0x9fb9cc, 0x8f979f, 0xd9a888, 0xf4a582, 0xd6604d, 0xb2182b];
const CLASSES = { good: "--good", unsure: "--unsure", bad: "--bad" };
/** Share of the radius of what is looked at: a touch, an arrow of the largest deviation, what an order stands off the part. */
const TOUCH = 0.022, ARROW = 0.28, LIFT = 0.05;

/** @type {any} */
let T = null;
/** @type {any} */
let view = null;
let drawn = "";

/** @param {string} name */
const colour = (name) => new T.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());
/** @param {string | null} text @param {number[]} standard */
const numbers = (text, standard) => text?.trim() ? text.trim().split(/\s+/).map(Number) : standard;

// --- the machine ------------------------------------------------------------------------------------------------------

/** Places a frame as an origin of URDF says. @param {any} node @param {Element | null} origin */
function place(node, origin) {
  const [x, y, z] = numbers(origin?.getAttribute("xyz") ?? null, [0, 0, 0]);
  const [roll, pitch, yaw] = numbers(origin?.getAttribute("rpy") ?? null, [0, 0, 0]);
  node.position.set(x, y, z);
  node.rotation.set(roll, pitch, yaw, "ZYX");
}

/** A box, a cylinder or a sphere; meshes are files on another host. @param {Element} visual @param {(name: string) => any} material */
function solid(visual, material) {
  const shape = visual.querySelector("geometry")?.firstElementChild;
  const of = (name) => Number(shape?.getAttribute(name));
  let geometry = null;
  if (shape?.tagName === "box") geometry = new T.BoxGeometry(...numbers(shape.getAttribute("size"), [0, 0, 0]));
  if (shape?.tagName === "cylinder") geometry = new T.CylinderGeometry(of("radius"), of("radius"), of("length"), 32).rotateX(Math.PI / 2);
  if (shape?.tagName === "sphere") geometry = new T.SphereGeometry(of("radius"), 24, 16);
  if (!geometry) return null;
  const body = new T.Mesh(geometry, material(visual.querySelector("material")?.getAttribute("name") ?? ""));
  place(body, visual.querySelector("origin"));
  return body;
}

/** Links, and what moves each joint. @param {string} text */
function machine(text) {
  const robot = new DOMParser().parseFromString(text, "application/xml").documentElement;
  const named = new Map();
  for (const one of robot.querySelectorAll("material[name]")) {
    const rgba = numbers(one.querySelector("color")?.getAttribute("rgba") ?? null, []);
    if (rgba.length === 4) named.set(one.getAttribute("name"), new T.Color().setRGB(rgba[0], rgba[1], rgba[2], T.SRGBColorSpace));
  }
  const material = (name) => new T.MeshStandardMaterial({ color: named.get(name) ?? 0x8a939c, roughness: 0.7, transparent: true, opacity: 0.42, depthWrite: false });
  const links = new Map(), joints = new Map(), whole = new T.Group();
  for (const one of robot.querySelectorAll(":scope > link")) {
    const link = new T.Group();
    link.name = one.getAttribute("name");
    for (const visual of one.querySelectorAll(":scope > visual")) {
      const body = solid(visual, material);
      if (body) link.add(body);
    }
    links.set(link.name, link);
  }
  const carried = new Set();
  for (const one of robot.querySelectorAll(":scope > joint")) {
    const parent = links.get(one.querySelector("parent")?.getAttribute("link"));
    const child = links.get(one.querySelector("child")?.getAttribute("link"));
    if (!parent || !child || carried.has(child)) continue;
    carried.add(child);
    const fixed = new T.Group(), moved = new T.Group();
    place(fixed, one.querySelector("origin"));
    parent.add(fixed.add(moved.add(child)));
    const axis = new T.Vector3(...numbers(one.querySelector("axis")?.getAttribute("xyz") ?? null, [1, 0, 0])).normalize();
    const turns = ["revolute", "continuous"].includes(one.getAttribute("type") ?? "");
    if (turns || one.getAttribute("type") === "prismatic") {
      joints.set(one.getAttribute("name"), (at) => { if (turns) moved.quaternion.setFromAxisAngle(axis, at); else moved.position.copy(axis).multiplyScalar(at); });
    }
  }
  for (const link of links.values()) if (!carried.has(link)) whole.add(link);
  return { whole, links, joints };
}

// --- the part ---------------------------------------------------------------------------------------------------------

/** Frees what was drawn. @param {any} group */
function clear(group) {
  group.traverse((one) => { one.geometry?.dispose(); one.material?.dispose(); });
  group.clear();
}

/** Features as lines, touches as balls with arrows, the order as a line. @param {any} data */
function part(data) {
  const group = view.part;
  clear(group);
  const [x, y, z, ...turn] = data.pose;
  group.position.set(x, y, z);
  if (turn.some((one) => one !== 0)) group.quaternion.set(...turn);
  const box = new T.Box3();
  const spot = (point) => new T.Vector3(point[1], point[2], point[3]);
  for (const point of data.points) box.expandByPoint(spot(point));
  const radius = Math.max(box.getSize(new T.Vector3()).length() / 2, 1e-3);
  let before = null;
  for (const line of data.lines) {
    const places = line.places.map((one) => new T.Vector3(...one));
    const ink = colour(CLASSES[line.class] ?? "--plain");
    const middle = places.reduce((sum, one) => sum.add(one), new T.Vector3()).divideScalar(places.length);
    const next = (index) => (index + 1) % places.length;
    // A wall between two rings of a feature, else a face within its outline.
    const wall = before?.feature === line.feature && before.places.length === places.length && before.middle.distanceTo(middle) > radius * 0.01;
    const face = wall ? places.flatMap((one, index) => [before.places[index], one, places[next(index)], before.places[index], places[next(index)], before.places[next(index)]])
      : places.flatMap((one, index) => [middle, one, places[next(index)]]);
    group.add(new T.LineLoop(new T.BufferGeometry().setFromPoints(places), new T.LineBasicMaterial({ color: ink, transparent: true })));
    group.add(new T.Mesh(new T.BufferGeometry().setFromPoints(face), new T.MeshBasicMaterial({ color: ink, side: T.DoubleSide, transparent: true, opacity: 0.16, depthWrite: false })));
    before = { feature: line.feature, places, middle };
  }
  const ball = new T.SphereGeometry(radius * TOUCH, 16, 12);
  view.touches = data.points.map((point, index) => {
    const touch = data.touches[index], normal = new T.Vector3(point[4], point[5], point[6]);
    const share = touch ? Math.max(-1, Math.min(1, touch[0] / data.end)) : 0;
    const ink = touch ? new T.Color(HEAT[Math.round((share + 1) / 2 * (HEAT.length - 1))]) : colour("--soft");
    const one = new T.Mesh(ball, new T.MeshBasicMaterial({ color: ink, transparent: true, opacity: touch ? 1 : 0.35 }));
    one.position.copy(spot(point));
    one.userData.said = touch ? `${data.features[point[0]]}, point ${index}: ${signed(touch[0])} µm, u ${touch[1].toFixed(1)} µm` : `${data.features[point[0]]}, point ${index}: not touched yet`;
    const length = Math.abs(share) * radius * ARROW;
    if (length > radius * 0.01) {
      const from = share > 0 ? one.position : one.position.clone().addScaledVector(normal, length);
      group.add(new T.ArrowHelper(normal.clone().multiplyScalar(Math.sign(share)), from, length, ink, Math.min(length, radius * 0.07), radius * 0.045));
    }
    group.add(one);
    return one;
  });
  const way = data.order.filter((index) => data.points[index]).map((index) => {
    const point = data.points[index];
    return spot(point).addScaledVector(new T.Vector3(point[4], point[5], point[6]), radius * LIFT);
  });
  group.add(new T.Line(new T.BufferGeometry().setFromPoints(way), new T.LineBasicMaterial({ color: colour("--accent"), transparent: true, opacity: 0.55 })));
  // After the machine, which is only a veil before it.
  group.traverse((one) => { one.renderOrder = 1; if (one.material) one.material.transparent = true; });
  view.centre = box.getCenter(new T.Vector3());
  view.radius = radius;
}

/** @param {number} um */
const signed = (um) => `${um < 0 ? "−" : "+"}${Math.abs(um).toFixed(1)}`;

// --- looking ----------------------------------------------------------------------------------------------------------

/** Draws once, when the browser has time. */
function draw() {
  view.due ||= requestAnimationFrame(drawNow);
}

function drawNow() {
  view.due = 0;
  const { camera, renderer, look } = view;
  const across = Math.cos(look.elevation);
  const towards = new T.Vector3(across * Math.cos(look.azimuth), across * Math.sin(look.azimuth), Math.sin(look.elevation));
  view.scene.updateMatrixWorld(true);
  const target = (look.machine ? view.middle.clone() : view.part.localToWorld(view.centre.clone())).add(look.offset);
  camera.position.copy(target).addScaledVector(towards, look.distance);
  camera.near = look.distance / 100;
  camera.far = look.distance * 20;
  camera.updateProjectionMatrix();
  camera.lookAt(target);
  renderer.render(view.scene, camera);
  // What is drawn can be read: the frame that carries the probe, m.
  const mount = view.links.get("probe_mount");
  if (mount) view.canvas.dataset.mount = new T.Vector3().setFromMatrixPosition(mount.matrixWorld).toArray().map((one) => one.toFixed(6)).join(" ");
}

/** Takes the size that the page gives. */
function resize() {
  const { clientWidth: width, clientHeight: height } = view.canvas;
  if (!width || !height) return;
  view.renderer.setSize(width, height, false);
  view.camera.aspect = width / height;
  drawNow();
}

/** @param {boolean} machine */
function fit(machine) {
  const box = new T.Box3().setFromObject(view.whole);
  view.middle = box.getCenter(new T.Vector3());
  view.look.machine = machine;
  view.whole.traverse((one) => { if (one.material && !one.renderOrder) one.material.opacity = machine ? 0.5 : 0.2; });
  view.look.offset.set(0, 0, 0);
  view.look.distance = machine ? box.getSize(new T.Vector3()).length() * 1.15 : view.radius * 4.6;
  draw();
}

/** @param {number} x @param {number} y */
function pick(x, y) {
  const frame = view.canvas.getBoundingClientRect();
  view.ray.setFromCamera(new T.Vector2((x - frame.left) / frame.width * 2 - 1, 1 - (y - frame.top) / frame.height * 2), view.camera);
  const [hit] = view.ray.intersectObjects(view.touches, false);
  if (hit) view.row.lastElementChild.textContent = hit.object.userData.said;
  return Boolean(hit);
}

function controls() {
  const { canvas, look } = view;
  let held = null;
  canvas.addEventListener("pointerdown", (event) => { held = event; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointerup", (event) => { held = null; pick(event.clientX, event.clientY); });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return void pick(event.clientX, event.clientY);
    const [x, y] = [event.movementX, event.movementY];
    if (event.shiftKey || event.buttons === 2) {
      const step = look.distance / canvas.clientHeight;
      look.offset.add(new T.Vector3(-x * step, y * step, 0).applyQuaternion(view.camera.quaternion));
    } else turn(-x * 0.008, y * 0.008);
    draw();
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(event.deltaY * 0.0012));
  }, { passive: false });
  const keys = { ArrowLeft: () => turn(-0.15, 0), ArrowRight: () => turn(0.15, 0), ArrowUp: () => turn(0, 0.15), ArrowDown: () => turn(0, -0.15), "+": () => zoom(0.85), "-": () => zoom(1.18) };
  canvas.addEventListener("keydown", (event) => {
    const act = keys[event.key];
    if (!act) return;
    event.preventDefault();
    event.stopPropagation();
    act();
    draw();
  });
}

/** @param {number} azimuth @param {number} elevation */
function turn(azimuth, elevation) {
  view.look.azimuth += azimuth;
  view.look.elevation = Math.max(-1.55, Math.min(1.55, view.look.elevation + elevation));
}

/** @param {number} factor */
function zoom(factor) {
  view.look.distance = Math.max(view.radius / 4, Math.min(50, view.look.distance * factor));
  draw();
}

/** Buttons that look at the part or at the whole machine. */
function buttons() {
  const row = document.createElement("p");
  row.className = "looks";
  for (const [text, act] of /** @type {[string, () => void][]} */ ([["Part", () => fit(false)], ["Machine", () => fit(true)], ["Sketch", sketch]])) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = text;
    button.onclick = act;
    row.append(button);
  }
  const reading = document.createElement("output");
  reading.textContent = "Point at a touch for its value";
  row.append(reading);
  return row;
}

function sketch() {
  const shown = document.body.classList.toggle("solid");
  view.row.children[2].textContent = shown ? "Sketch" : "In 3D";
  if (shown) draw();
}

// --- with the page ----------------------------------------------------------------------------------------------------

/** A computer that draws by its processor alone would have no time for the page: there a person asks for the picture.
 * @param {HTMLElement} home @param {boolean} asked */
async function begin(home, asked) {
  const canvas = document.createElement("canvas");
  const found = canvas.getContext("webgl2", { antialias: true, failIfMajorPerformanceCaveat: !asked });
  const named = found?.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? found?.RENDERER;
  const bySoftware = found && /swiftshader|llvmpipe|software/i.test(found.getParameter(named));
  const context = bySoftware && !asked ? null : found;
  offered = !context && !asked;
  if (offered) offer();
  if (!context) return;
  T = await import("/assets/vendor/three.module.min.js");
  const answer = await fetch(home.dataset.description ?? "");
  const { whole, links, joints } = machine(answer.ok ? await answer.text() : "<robot/>");
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "Machine and part in three dimensions: drag or arrow keys turn, the wheel or + and − zoom; the values stand in the table of sizes");
  const renderer = new T.WebGLRenderer({ canvas, context, antialias: true, alpha: true });
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  const camera = new T.PerspectiveCamera(35, 1, 0.001, 50);
  camera.up.set(0, 0, 1);
  const scene = new T.Scene();
  const sun = new T.DirectionalLight(0xffffff, 2.2);
  sun.position.set(1, -2, 3);
  scene.add(new T.HemisphereLight(0xffffff, 0x667788, 1.6), sun, whole);
  const carried = new T.Group();
  (links.get("workpiece") ?? whole).add(carried);
  view = { canvas, renderer, camera, scene, whole, links, joints, part: carried, touches: [], centre: new T.Vector3(), middle: new T.Vector3(), radius: 0.05, ray: new T.Raycaster(), due: 0,
    look: { azimuth: -1, elevation: 0.45, distance: 1, machine: false, offset: new T.Vector3() } };
  view.row = buttons();
  controls();
  take();
  document.body.classList.add("solid");
  fit(false);
  resize();
  new ResizeObserver(resize).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { drawn = ""; take(); });
}

/** Takes over what the page says now. */
function take() {
  const home = /** @type {HTMLElement | null} */ (document.querySelector("#part .scene"));
  if (!home || !view) return;
  if (view.canvas.parentElement !== home) home.append(view.canvas, view.row);
  const data = home.dataset.part ?? "";
  if (data !== drawn) {
    drawn = data;
    part(JSON.parse(data));
  }
  const said = /** @type {HTMLElement | null} */ (document.querySelector("#axes [data-joints]"))?.dataset.joints;
  for (const [name, at] of Object.entries(said ? JSON.parse(said) : {})) view.joints.get(name)?.(at);
  draw();
}

let beginning = false, offered = false;

/** @param {HTMLElement} home @param {boolean} asked */
function start(home, asked) {
  begin(home, asked).catch((error) => console.warn("no picture in three dimensions:", error));
}

function offer() {
  const turn = document.querySelector("#part .turn");
  if (!turn || turn.querySelector("button")) return;
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "In 3D";
  button.onclick = () => {
    offered = false;
    button.remove();
    const home = /** @type {HTMLElement | null} */ (document.querySelector("#part .scene"));
    if (home) start(home, true);
  };
  turn.append(button);
}

function follow() {
  const home = /** @type {HTMLElement | null} */ (document.querySelector("#part .scene"));
  if (view) take();
  else if (offered) offer();
  else if (home && !beginning) {
    beginning = true;
    start(home, false);
  }
}

addEventListener("put", follow);
follow();
