"use strict";
// The patient's page: turns the surfaces, shows and hides them, plays the dates. Everything it needs is in the page.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const all = (selector) => Array.from(document.querySelectorAll(selector));
  const last = data.dates.length - 1;
  // With many outlines on one another, where they agree is easier to see.
  const manyMasks = data.colors.length > 3;
  const state = {
    date: last,
    masks: data.colors.map(() => !manyMasks),
    levels: (data.dates[last].levels || []).map(() => manyMasks),
    mode: manyMasks ? "levels" : "masks",
    head: true,
    azimuth: 0,
    elevation: 0.2,
    zoom: 1,
  };
  let view = null;

  // ---- what is shown ----

  // What is hidden is pale, but not all that belongs to the other mode.
  function press(part, kind, n) {
    const isOn = Boolean(state[kind][n]);
    part.setAttribute("aria-pressed", String(isOn));
    part.classList.toggle("off", !isOn && state.mode === kind);
  }

  function update() {
    const date = data.dates[state.date];
    for (const part of all("section.date")) part.hidden = Number(part.dataset.date) !== state.date;
    for (const button of all(".date-button")) button.setAttribute("aria-pressed", String(Number(button.dataset.date) === state.date));
    if (byId("when")) byId("when").textContent = date.name;
    for (const part of all("[data-mask]")) press(part, "masks", Number(part.dataset.mask));
    for (const part of all("[data-level]")) press(part, "levels", Number(part.dataset.level));
    for (const part of all("[data-volume]")) part.textContent = date.volumes[Number(part.dataset.volume)];
    if (byId("mode-masks")) {
      for (const kind of ["masks", "levels"]) byId("mode-" + kind).setAttribute("aria-pressed", String(state.mode === kind));
      for (const part of all("[data-of-mode]")) {
        const isOfDate = part.dataset.ofDate === undefined || Number(part.dataset.ofDate) === state.date;
        part.hidden = part.dataset.ofMode !== state.mode || !isOfDate;
      }
    }
    for (const path of all("[data-mask-path]")) path.style.display = state.masks[Number(path.dataset.maskPath)] ? "inline" : "none";
    for (const path of all("[data-level-path]")) path.style.display = state.levels[Number(path.dataset.levelPath)] ? "inline" : "none";
    if (byId("head")) byId("head").setAttribute("aria-pressed", String(state.head));
    draw();
  }

  function setDate(n) {
    state.date = n;
    const many = data.dates[n].levels.length;
    state.levels = Array.from({ length: many }, (_, k) => (k < state.levels.length ? state.levels[k] : state.mode === "levels"));
    update();
  }

  function toggle(kind, n) {
    const other = kind === "masks" ? "levels" : "masks";
    // One or the other: both at once would hide each other.
    state[other] = state[other].map(() => false);
    state.mode = kind;
    state[kind][n] = !state[kind][n];
    update();
  }

  function pressed(element, act) {
    element.addEventListener("click", act);
    if (element.tagName !== "BUTTON") {
      element.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") {
          event.preventDefault();
          act();
        }
      });
    }
  }
  for (const part of all("[data-mask]")) pressed(part, () => toggle("masks", Number(part.dataset.mask)));
  for (const part of all("[data-level]")) pressed(part, () => toggle("levels", Number(part.dataset.level)));
  if (byId("head")) pressed(byId("head"), () => { state.head = !state.head; update(); });
  if (byId("mode-masks")) {
    for (const kind of ["masks", "levels"]) {
      pressed(byId("mode-" + kind), () => {
        state.mode = kind;
        state.masks.fill(kind === "masks");
        state.levels.fill(kind === "levels");
        update();
      });
    }
  }

  // ---- dates ----

  let timer = null;
  function stop() {
    if (timer !== null) clearInterval(timer);
    timer = null;
    say(false);
  }
  function say(isPlaying) {
    const button = byId("play");
    if (!button) return;
    button.querySelector(".sign").textContent = isPlaying ? "❚❚ " : "▶ ";
    button.querySelector(".text").textContent = isPlaying ? data.words.stop : data.words.play;
  }
  if (byId("play")) {
    pressed(byId("play"), () => {
      if (timer !== null) return stop();
      say(true);
      setDate((state.date + 1) % data.dates.length);
      timer = setInterval(() => setDate((state.date + 1) % data.dates.length), 1500);
    });
  }
  for (const button of all(".date-button")) pressed(button, () => { stop(); setDate(Number(button.dataset.date)); });

  // ---- true size ----

  const scaled = ["true-outlines", "true-bar", "card"].map(byId).filter(Boolean);
  if (byId("fit")) {
    byId("fit").hidden = false;
    byId("fit-scale").addEventListener("input", (event) => {
      for (const svg of scaled) {
        svg.setAttribute("width", svg.dataset.width * event.target.value + "mm");
        svg.setAttribute("height", svg.dataset.height * event.target.value + "mm");
      }
    });
  }
  byId("print").hidden = false;
  pressed(byId("print"), () => window.print());

  // ---- 3D ----

  const FIELD_OF_VIEW = 28;
  const MOST_ELEVATION = 1.45;
  const ZOOMS = [0.7, 8];
  const TURN_STEP = Math.PI / 12;
  // Around what reaches farthest, and from the middle to the words for left and right.
  const ROOM = 1.03;
  const TAG_SHIFT = 0.12;
  // Light is softer than the steps between voxels; positions stay.
  const NORMAL_STEPS = 3;
  const HEAD_NORMAL_STEPS = 10;
  // Surfaces that coincide lie behind one another by this, seen from the eye: else they mix at random.
  const APART_MM = 0.35;

  function bytes(base64) {
    const text = atob(base64);
    const out = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) out[i] = text.charCodeAt(i);
    return out.buffer;
  }

  // Positions stay the stored numbers: all axes have one step, so that normals are the same.
  const geometries = new Map();
  function geometry(n) {
    if (!geometries.has(n)) {
      const surface = data.surfaces[n];
      const shape = new THREE.BufferGeometry();
      shape.setAttribute("position", new THREE.BufferAttribute(new Uint16Array(bytes(surface.positions)), 3));
      const indices = bytes(surface.indices);
      shape.setIndex(new THREE.BufferAttribute(surface.wide ? new Uint32Array(indices) : new Uint16Array(indices), 1));
      shape.computeVertexNormals();
      for (let step = 0; step < (n === data.head ? HEAD_NORMAL_STEPS : NORMAL_STEPS); step++) soften(shape);
      shape.computeBoundingBox();
      geometries.set(n, shape);
    }
    return geometries.get(n);
  }
  // Each normal becomes the mean of those of its triangles.
  function soften(shape) {
    const normals = shape.getAttribute("normal").array;
    const index = shape.getIndex().array;
    const sums = new Float32Array(normals.length);
    for (let t = 0; t < index.length; t += 3) {
      for (let axis = 0; axis < 3; axis++) {
        const sum = normals[3 * index[t] + axis] + normals[3 * index[t + 1] + axis] + normals[3 * index[t + 2] + axis];
        for (let k = 0; k < 3; k++) sums[3 * index[t + k] + axis] += sum;
      }
    }
    for (let v = 0; v < sums.length; v += 3) {
      const length = Math.hypot(sums[v], sums[v + 1], sums[v + 2]) || 1;
      for (let axis = 0; axis < 3; axis++) normals[v + axis] = sums[v + axis] / length;
    }
  }
  function placed(n, material) {
    const mesh = new THREE.Mesh(geometry(n), material);
    mesh.position.fromArray(data.surfaces[n].origin);
    mesh.scale.setScalar(data.surfaces[n].step);
    return mesh;
  }
  function grow(box, n) {
    const surface = data.surfaces[n];
    const own = geometry(n).boundingBox;
    for (let axis = 0; axis < 3; axis++) {
      box.lo[axis] = Math.min(box.lo[axis], surface.origin[axis] + own.min.getComponent(axis) * surface.step);
      box.hi[axis] = Math.max(box.hi[axis], surface.origin[axis] + own.max.getComponent(axis) * surface.step);
    }
  }
  // How far a surface reaches from a place.
  function reach(n, from) {
    const { origin, step } = data.surfaces[n];
    const at = geometry(n).getAttribute("position").array;
    let most = 0;
    for (let v = 0; v < at.length; v += 3) {
      most = Math.max(most, Math.hypot(origin[0] + at[v] * step - from.x, origin[1] + at[v + 1] * step - from.y, origin[2] + at[v + 2] * step - from.z));
    }
    return most;
  }
  const emptyBox = () => ({ lo: [Infinity, Infinity, Infinity], hi: [-Infinity, -Infinity, -Infinity] });
  const middle = (box) => new THREE.Vector3(...box.lo.map((v, i) => (v + box.hi[i]) / 2));

  // First the depth of a surface, then its colour: one layer of it, however it folds.
  function layered(n, color, opacity, order) {
    const rgb = new THREE.Color().setRGB(color[0] / 255, color[1] / 255, color[2] / 255, "srgb");
    const depth = placed(n, new THREE.MeshBasicMaterial({ colorWrite: false, transparent: true }));
    const paint = placed(n, new THREE.MeshLambertMaterial({ color: rgb, transparent: true, opacity, depthFunc: THREE.LessEqualDepth }));
    depth.renderOrder = 2 * order;
    paint.renderOrder = 2 * order + 1;
    const group = new THREE.Group();
    group.add(depth, paint);
    group.userData.order = order;
    return group;
  }

  function ghost(n) {
    const material = new THREE.ShaderMaterial({
      transparent: true,
      depthWrite: false,
      uniforms: { color: { value: new THREE.Vector3() } },
      vertexShader: "varying vec3 n; varying vec3 v; void main() { vec4 at = modelViewMatrix * vec4(position, 1.0); n = normalMatrix * normal; v = -at.xyz; gl_Position = projectionMatrix * at; }",
      fragmentShader: "uniform vec3 color; varying vec3 n; varying vec3 v; void main() { float rim = 1.0 - abs(dot(normalize(n), normalize(v))); gl_FragColor = vec4(color, mix(0.10, 0.62, pow(rim, 2.0))); }",
    });
    const mesh = placed(n, material);
    mesh.renderOrder = 1000;
    return mesh;
  }

  function start() {
    const canvas = byId("canvas");
    const renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: true });
    const scene = new THREE.Scene();
    const camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW, 1, 1, 10000);
    scene.add(new THREE.HemisphereLight(0xffffff, 0x8892a0, 1.5));
    const sun = new THREE.DirectionalLight(0xffffff, 2.2);
    sun.position.set(-0.5, 0.8, 1);
    camera.add(sun);
    scene.add(camera);

    const tumor = emptyBox();
    const dates = data.dates.map((date) => {
      const outer = date.levels.length ? [date.levels[0]] : date.masks;
      for (const n of outer) if (n !== null) grow(tumor, n);
      // Small ones first: what is larger lies around them.
      const size = (n) => { const b = geometry(n).boundingBox; const s = data.surfaces[n].step; return (b.max.x * b.max.y * b.max.z) * s * s * s; };
      const bySize = date.masks.map((n, k) => ({ n, k })).filter((m) => m.n !== null).sort((a, b) => size(a.n) - size(b.n));
      const masks = date.masks.map(() => null);
      bySize.forEach((mask, order) => { masks[mask.k] = layered(mask.n, data.colors[mask.k], 0.62, order); });
      const many = date.levels.length;
      const levels = date.levels.map((n, k) => (n === null ? null : layered(n, date.levelColors[k], k === many - 1 ? 0.95 : 0.32, many - k)));
      for (const part of [...masks, ...levels]) if (part) scene.add(part);
      return { masks, levels };
    });
    const head = data.head === null ? null : ghost(data.head);
    const whole = emptyBox();
    if (head) {
      grow(whole, data.head);
      scene.add(head);
    }
    for (const axis of [0, 1, 2]) {
      whole.lo[axis] = Math.min(whole.lo[axis], tumor.lo[axis]);
      whole.hi[axis] = Math.max(whole.hi[axis], tumor.hi[axis]);
    }
    const center = middle(whole);
    const focus = middle(tumor);
    const outer = data.dates.flatMap((date) => (date.levels.length ? [date.levels[0]] : date.masks)).concat([data.head]);
    const radius = ROOM * Math.max(...outer.map((n) => (n === null ? 0 : reach(n, center))));
    // From the front, turned to the side where the tumour is.
    const home = { azimuth: Math.sign(center.x - focus.x || 1) * 0.6, elevation: 0.22, zoom: 1 };
    Object.assign(state, home);

    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    const tint = () => { if (head) head.material.uniforms.color.value.set(...(dark.matches ? [0.62, 0.72, 0.85] : [0.36, 0.46, 0.58])); };
    tint();
    dark.addEventListener("change", () => { tint(); draw(); });

    const wide = whole.hi[0] - whole.lo[0];
    const tags = [["tag-left", whole.lo[0] - TAG_SHIFT * wide], ["tag-right", whole.hi[0] + TAG_SHIFT * wide]].map(([id, x]) => ({ element: byId(id), x })).filter((tag) => tag.element);

    let isDue = false;
    function paint() {
      isDue = false;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      if (width === 0 || height === 0) return;
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      renderer.setPixelRatio(ratio);
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      const half = (FIELD_OF_VIEW / 2) * (Math.PI / 180);
      const fit = Math.min(1, camera.aspect);
      const distance = radius / Math.sin(Math.atan(Math.tan(half) * fit)) / state.zoom;
      // Nearer, the tumour comes to the middle.
      const t = Math.min(1, Math.max(0, (state.zoom - 1) / 1.5));
      const target = center.clone().lerp(focus, t * t * (3 - 2 * t));
      const flat = Math.cos(state.elevation);
      camera.up.set(0, 0, 1);
      camera.position.set(-Math.sin(state.azimuth) * flat, Math.cos(state.azimuth) * flat, Math.sin(state.elevation)).multiplyScalar(distance).add(target);
      camera.near = Math.max(1, distance / 100);
      camera.far = distance + 4 * radius;
      camera.updateProjectionMatrix();
      camera.lookAt(target);
      const away = target.clone().sub(camera.position).normalize();
      const show = (parts, d, isOn) => parts.forEach((part, k) => {
        if (!part) return;
        part.visible = d === state.date && isOn[k];
        part.position.copy(away).multiplyScalar(APART_MM * part.userData.order);
      });
      dates.forEach((date, d) => {
        show(date.masks, d, state.masks);
        show(date.levels, d, state.levels);
      });
      if (head) head.visible = state.head;
      renderer.render(scene, camera);
      for (const { element, x } of tags) {
        const at = new THREE.Vector3(x, center.y, center.z).project(camera);
        const [w, h] = [element.offsetWidth, element.offsetHeight];
        const left = Math.min(width - w - 4, Math.max(4, ((at.x + 1) / 2) * width - w / 2));
        const top = Math.min(height - h - 4, Math.max(4, ((1 - at.y) / 2) * height - h / 2));
        element.style.transform = "translate(" + left.toFixed(1) + "px," + top.toFixed(1) + "px)";
      }
    }
    view = { due: () => { if (!isDue) { isDue = true; requestAnimationFrame(paint); } } };

    function turn(right, up) {
      state.azimuth += right;
      state.elevation = Math.min(MOST_ELEVATION, Math.max(-MOST_ELEVATION, state.elevation + up));
      draw();
    }
    function zoom(factor) {
      state.zoom = Math.min(ZOOMS[1], Math.max(ZOOMS[0], state.zoom * factor));
      draw();
    }

    const fingers = new Map();
    const spread = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    canvas.addEventListener("pointermove", (event) => {
      const finger = fingers.get(event.pointerId);
      if (!finger) return;
      const before = fingers.size === 2 ? spread() : 0;
      const [dx, dy] = [event.clientX - finger.x, event.clientY - finger.y];
      finger.x = event.clientX;
      finger.y = event.clientY;
      if (fingers.size === 1) turn(-dx * 0.01, dy * 0.01);
      else if (before > 0) zoom(spread() / before);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
    // The wheel scrolls the page but where the view was chosen.
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      zoom(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    const keys = { ArrowLeft: () => turn(TURN_STEP, 0), ArrowRight: () => turn(-TURN_STEP, 0), ArrowUp: () => turn(0, TURN_STEP / 2), ArrowDown: () => turn(0, -TURN_STEP / 2), "+": () => zoom(1.25), "-": () => zoom(0.8), Home: () => reset() };
    canvas.addEventListener("keydown", (event) => {
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
    function reset() { Object.assign(state, home); draw(); }
    pressed(byId("turn-left"), keys.ArrowLeft);
    pressed(byId("turn-right"), keys.ArrowRight);
    pressed(byId("closer"), keys["+"]);
    pressed(byId("farther"), keys["-"]);
    pressed(byId("reset"), reset);
    new ResizeObserver(() => draw()).observe(canvas);
    canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); flat(); });
    canvas.addEventListener("webglcontextrestored", () => { byId("flat").hidden = true; byId("view").hidden = false; draw(); });
    byId("flat").hidden = true;
    byId("view").hidden = false;
  }

  function draw() {
    if (view) view.due();
  }
  function flat() {
    byId("flat").hidden = false;
    byId("view").hidden = true;
  }

  // Before anything is decoded: without WebGL the pictures are the page.
  const probe = document.createElement("canvas").getContext("webgl2");
  try {
    if (probe) start();
  } catch (why) {
    flat();
  }
  if (!view) {
    // The buttons of the masks are with the 3D view; the diagrams' parts still show and hide outlines.
    flat();
  }
  update();
})();
