// Turns, shifts and enlarges the clouds of a page: one view per <figure class="cloud-view">, as the
// camera sees the scene at first. Without WebGL 2 the still picture in the figure stays.

const FIT = 0.9;                              // share of the view that the cloud fills at first
const TURN_PER_PX = 0.008;                    // rad: half a turn takes 400 px
const KEY_TURN = Math.PI / 36, KEY_SHIFT_PX = 30, KEY_ZOOM = 1.2;
const LEAST_ZOOM = 0.2, MOST_ZOOM = 200;
const BAR_PX = 140;                           // longest scale bar
const TRIAD_PX = 34;                          // length of an axis
const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1]; // rotations are row by row
const AXES = [["x", "#e5484d"], ["y", "#2f9e5b"], ["z", "#3f83f8"]];
const HINT = "Drag to turn; shift-drag or right-drag to shift; wheel (after a click) or pinch to " +
  "zoom; double click to reset. Keys: arrows turn, shift and arrows shift, + − zoom, 0 resets.";

function multiply(a, b) {
  return IDENTITY.map((_, i) => {
    const row = i - i % 3, column = i % 3;
    return a[row] * b[column] + a[row + 1] * b[column + 3] + a[row + 2] * b[column + 6];
  });
}

// About the screen's upright and level axes: what is near follows the pointer.
function turned(turn, right, down) {
  const c = Math.cos(right), s = Math.sin(right), d = Math.cos(down), t = Math.sin(down);
  return multiply([1, 0, 0, 0, d, -t, 0, t, d], multiply([c, 0, -s, 0, 1, 0, s, 0, c], turn));
}

function drawAxes(pen, turn, height) {
  const [x0, y0] = [TRIAD_PX + 24, height - TRIAD_PX - 24];
  const ends = AXES.map(([name, colour], i) => [name, colour, turn[i], turn[i + 3], turn[i + 6]]);
  pen.lineWidth = 2;
  for (const [name, colour, x, y] of ends.sort((one, other) => other[4] - one[4])) {  // far ones first
    const length = Math.hypot(x, y);
    pen.strokeStyle = pen.fillStyle = colour;
    pen.beginPath();
    pen.moveTo(x0, y0);
    pen.lineTo(x0 + TRIAD_PX * x, y0 + TRIAD_PX * y);
    pen.stroke();
    pen.beginPath();
    pen.arc(x0 + TRIAD_PX * x, y0 + TRIAD_PX * y, 3, 0, 2 * Math.PI);
    pen.fill();
    // An axis along the line of sight has its name beside the origin.
    const [right, below] = length > 0.3 ? [x / length, y / length] : [-0.7, -0.7];
    pen.fillText(name, x0 + TRIAD_PX * x + 11 * right, y0 + TRIAD_PX * y + 11 * below);
  }
}

function drawBar(pen, pxPerMm, { width, height }) {
  const most = Math.min(BAR_PX, width / 3) / pxPerMm, power = 10 ** Math.floor(Math.log10(most));
  const mm = [5, 2, 1].find((digit) => digit * power <= most) * power, length = mm * pxPerMm;
  const [right, base] = [width - 20, height - 20];
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(right - length, base - 5);
  pen.lineTo(right - length, base);
  pen.lineTo(right, base);
  pen.lineTo(right, base - 5);
  pen.stroke();
  pen.fillText(`${Number(mm.toPrecision(1))} mm`, right - length / 2, base - 12);
}

function make(tag, parent, properties = {}) {
  const element = document.createElement(tag);
  parent.append(Object.assign(element, properties));
  return element;
}

// The size of the view in px, both canvases brought to it at the screen's density.
function fitTo(frame, canvases) {
  const density = window.devicePixelRatio || 1, width = frame.clientWidth, height = frame.clientHeight;
  const pixels = { width: Math.round(width * density), height: Math.round(height * density) };
  for (const canvas of canvases)                // to set a size clears, and takes its time
    if (canvas.width !== pixels.width || canvas.height !== pixels.height) Object.assign(canvas, pixels);
  return { width, height, density };
}

function drawOver(pen, turn, pxPerMm, size) {
  pen.setTransform(size.density, 0, 0, size.density, 0, 0);
  pen.clearRect(0, 0, size.width, size.height);
  Object.assign(pen, { font: "600 13px system-ui, sans-serif", textAlign: "center", textBaseline: "middle" });
  pen.strokeStyle = pen.fillStyle = getComputedStyle(pen.canvas).color;
  drawBar(pen, pxPerMm, size);
  drawAxes(pen, turn, size.height);
}

function show(figure) {
  const data = JSON.parse(figure.querySelector("script").textContent);
  const stage = document.createElement("div"), bar = make("div", stage, { className: "bar" });
  const frame = make("div", stage, { className: "frame" });
  const canvas = make("canvas", frame, { tabIndex: 0, role: "application" }), over = make("canvas", frame);
  const painting = paintingOn(canvas, data);
  if (!painting) return;
  canvas.ariaLabel = `3D view: ${data.caption} ${HINT}`;
  make("p", stage, { className: "hint", textContent: HINT });
  stage.className = "stage";
  figure.prepend(stage);
  figure.classList.add("live");
  canvas.addEventListener("webglcontextlost", () => figure.classList.remove("live"));
  const [change, moves] = movesOf(frame, painting, [canvas, over]);
  addModes(bar, data.modes, (mode) => change(() => painting.colour(mode)));
  addPointers(canvas, moves);
  addKeys(canvas, moves);
}

// What can be done to a view, each followed by one drawing.
function movesOf(frame, painting, canvases) {
  const pose = { turn: IDENTITY, zoom: 1, right: 0, down: 0 }, pen = canvases[1].getContext("2d");
  let asked = false;

  function draw() {
    asked = false;
    const size = fitTo(frame, canvases);
    if (!size.width) return;
    const [x, y] = painting.halfMm;
    const pxPerMm = pose.zoom * FIT / 2 * Math.min(size.width / x, size.height / y);
    painting.paint(pose, pxPerMm, size);
    drawOver(pen, pose.turn, pxPerMm, size);
  }

  function change(step) {
    step();
    if (!asked) requestAnimationFrame(draw);
    asked = true;
  }

  const redraw = () => change(() => {});
  new ResizeObserver(redraw).observe(frame);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  return [change, {
    turn: (right, down) => change(() => { pose.turn = turned(pose.turn, right, down); }),
    shift: (right, down) => change(() => { pose.right += right; pose.down += down; }),
    reset: () => change(() => Object.assign(pose, { turn: IDENTITY, zoom: 1, right: 0, down: 0 })),
    // The point under (x, y), px from the middle of the view, stays where it is.
    zoom: (factor, x = 0, y = 0) => change(() => {
      const next = Math.min(Math.max(pose.zoom * factor, LEAST_ZOOM), MOST_ZOOM), by = next / pose.zoom;
      Object.assign(pose, { zoom: next, right: x + (pose.right - x) * by, down: y + (pose.down - y) * by });
    }),
  }];
}

// Buttons that choose what the colours mean, and their legend.
function addModes(bar, modes, choose) {
  const group = make("div", bar, { className: "modes", role: "group", ariaLabel: "colour by" });
  const legend = make("div", bar, { className: "legend" });
  const label = make("span", legend, { className: "label" }), low = make("span", legend);
  const scale = make("canvas", legend, { width: 255, height: 1 }), high = make("span", legend);
  const buttons = modes.map((mode, i) => make("button", group, {
    type: "button", textContent: mode.name, onclick: () => select(i),
  }));
  function select(chosen) {
    buttons.forEach((button, i) => { button.ariaPressed = String(i === chosen); });
    for (const [name, part] of Object.entries({ label, low, high })) part.textContent = modes[chosen][name];
    const colours = decode(modes[chosen].colours, Uint8Array), pixels = new ImageData(255, 1);
    pixels.data.forEach((_, i) => { pixels.data[i] = i % 4 === 3 ? 255 : colours[(i >> 2) * 3 + i % 4]; });
    scale.getContext("2d").putImageData(pixels, 0, 0);
    choose(chosen);
  }
  select(0);
}

function addPointers(canvas, { turn, shift, zoom, reset }) {
  const down = new Map();                     // where each finger or button is
  const fromMiddle = (x, y) => {
    const box = canvas.getBoundingClientRect();
    return [x - box.left - box.width / 2, y - box.top - box.height / 2];
  };
  canvas.addEventListener("pointerdown", (event) => {
    down.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
  });
  for (const name of ["pointerup", "pointercancel"])
    canvas.addEventListener(name, (event) => down.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const before = down.get(event.pointerId);
    if (!before) return;
    down.set(event.pointerId, event);
    const [right, below] = [event.clientX - before.clientX, event.clientY - before.clientY];
    const other = [...down.values()].find((one) => one.pointerId !== event.pointerId);
    if (other) {                              // half of what each of two fingers does
      shift(right / 2, below / 2);
      const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      const [x, y] = [(event.clientX + other.clientX) / 2, (event.clientY + other.clientY) / 2];
      zoom(apart(event) / Math.max(apart(before), 1), ...fromMiddle(x, y));
    } else if (event.shiftKey || event.buttons & 6) shift(right, below);
    else turn(right * TURN_PER_PX, below * TURN_PER_PX);
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", reset);
  canvas.addEventListener("wheel", (event) => {
    // Whoever only scrolls past is not held up; a pinch on a touch pad comes with ctrl.
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    const px = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
    zoom(Math.exp(-px * (event.ctrlKey ? 0.01 : 0.0015)), ...fromMiddle(event.clientX, event.clientY));
  }, { passive: false });
}

function addKeys(canvas, { turn, shift, zoom, reset }) {
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  canvas.addEventListener("keydown", (event) => {
    const arrow = arrows[event.key];
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (arrow && event.shiftKey) shift(...arrow.map((sign) => sign * KEY_SHIFT_PX));
    else if (arrow) turn(...arrow.map((sign) => sign * KEY_TURN));
    else if ("+=".includes(event.key)) zoom(KEY_ZOOM);
    else if ("-_".includes(event.key)) zoom(1 / KEY_ZOOM);
    else if (event.key === "0" || event.key === "Home") reset();
    else return;
    event.preventDefault();
  });
}

document.querySelectorAll("figure.cloud-view").forEach(show);
