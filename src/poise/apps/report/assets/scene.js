"use strict";
// What the report's replay and the live page share: ground, light, the robot's shapes, marks, polygons.
window.poiseScene = (canvas, { bodies, geometries, meshes }, height, { fov, shadows, ratio, renderer: how }) => {
  const T = window.POISE_THREE;
  const SKY = 0xe8eef4;
  const GROUND = 80;
  const TILE = 256;
  const renderer = new T.WebGLRenderer({ canvas, ...how });
  renderer.setPixelRatio(ratio);
  renderer.shadowMap.enabled = shadows;
  renderer.shadowMap.type = T.PCFShadowMap;

  const scene = new T.Scene();
  const camera = new T.PerspectiveCamera(fov, 2, 0.02, 200);
  camera.up.set(0, 0, 1);
  const controls = new T.OrbitControls(camera, canvas);
  controls.enableDamping = false;
  controls.maxPolarAngle = 0.52 * Math.PI;
  scene.background = new T.Color(SKY);
  scene.fog = new T.Fog(SKY, 6 * height + 3, 16 * height + 8);

  // ---- ground and light --------------------------------------------------------------------------
  scene.add(new T.HemisphereLight(0xffffff, 0xc4ccd4, 2.1));
  const sun = new T.DirectionalLight(0xffffff, 2.1);
  sun.castShadow = shadows;
  sun.shadow.mapSize.set(1024, 1024);
  const reach = 1.5 * height;
  Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
  sun.shadow.camera.far = 8 * height;
  sun.shadow.bias = -0.0015;
  sun.shadow.normalBias = 0.01;
  scene.add(sun, sun.target);

  // The ground is a picture of one square metre, repeated: lines of their own would flicker.
  function groundPicture() {
    const tile = document.createElement("canvas");
    tile.width = TILE;
    tile.height = TILE;
    const pen = tile.getContext("2d");
    pen.fillStyle = "#f6f8fa";
    pen.fillRect(0, 0, TILE, TILE);
    for (let i = 0; i <= 5; i += 1) {
      const edge = i % 5 === 0;
      const wide = edge ? 3 : 2;
      pen.fillStyle = edge ? "#b3bfcb" : "#dde4eb";
      pen.fillRect((i * TILE) / 5 - wide / 2, 0, wide, TILE);
      pen.fillRect(0, (i * TILE) / 5 - wide / 2, TILE, wide);
    }
    pen.fillStyle = "#b3bfcb";
    for (const at of [0, TILE - 1.5]) {
      pen.fillRect(at, 0, 1.5, TILE);
      pen.fillRect(0, at, TILE, 1.5);
    }
    const picture = new T.CanvasTexture(tile);
    picture.wrapS = T.RepeatWrapping;
    picture.wrapT = T.RepeatWrapping;
    picture.repeat.set(GROUND, GROUND);
    picture.anisotropy = renderer.capabilities.getMaxAnisotropy();
    picture.colorSpace = "srgb";
    return picture;
  }
  const plane = (material, z) => {
    const made = new T.Mesh(new T.PlaneGeometry(GROUND, GROUND), material);
    made.position.z = z;
    scene.add(made);
    return made;
  };
  const ground = [plane(new T.MeshBasicMaterial({ map: groundPicture() }), -0.004)];
  if (shadows) {
    ground.push(plane(new T.ShadowMaterial({ opacity: 0.22 }), -0.001));
    ground[1].receiveShadow = true;
  }
  // Ground and light go along with the robot.
  function follow(x, y) {
    for (const part of ground) {
      // Whole metres, so that the lines of the ground stay where they are.
      part.position.x = Math.round(x);
      part.position.y = Math.round(y);
    }
    sun.position.set(x + 1.2 * height, y - 1.0 * height, 3 * height);
    sun.target.position.set(x, y, 0.4 * height);
  }
  follow(0, 0);

  // ---- the robot -----------------------------------------------------------------------------------
  const { bytes } = window.poiseScene;
  function meshGeometry(mesh) {
    const packed = new Uint16Array(bytes(mesh.vertices));
    const points = new Float32Array(packed.length);
    for (let i = 0; i < packed.length; i += 1) {
      points[i] = mesh.low[i % 3] + packed[i] * mesh.step[i % 3];
    }
    const raw = bytes(mesh.faces);
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.BufferAttribute(points, 3));
    const index = mesh.wide ? new Uint32Array(raw) : new Uint16Array(raw);
    geometry.setIndex(new T.BufferAttribute(index, 1));
    return geometry;
  }
  const drawn = meshes.map(meshGeometry);
  function shape(g) {
    const s = g.size;
    if (g.shape === "box") return new T.BoxGeometry(2 * s[0], 2 * s[1], 2 * s[2]);
    if (g.shape === "sphere") return new T.SphereGeometry(s[0], 28, 20);
    if (g.shape === "ellipsoid") return new T.SphereGeometry(1, 28, 20).scale(s[0], s[1], s[2]);
    if (g.shape === "mesh") return drawn[g.mesh];
    // three.js has these along y; the record has them along z.
    const along =
      g.shape === "capsule"
        ? new T.CapsuleGeometry(s[0], 2 * s[1], 8, 24)
        : new T.CylinderGeometry(s[0], s[0], 2 * s[1], 32);
    return along.rotateX(Math.PI / 2);
  }
  const groups = [];
  for (let b = 0; b < bodies; b += 1) {
    groups.push(new T.Group());
    scene.add(groups[b]);
  }
  const materials = new Map();
  function material(rgba, flat) {
    const key = `${rgba} ${flat}`;
    if (!materials.has(key)) {
      const made = new T.MeshStandardMaterial({ roughness: 0.62, metalness: 0.05, flatShading: flat });
      made.color.setRGB(rgba[0], rgba[1], rgba[2], "srgb");
      made.opacity = rgba[3];
      made.transparent = rgba[3] < 1;
      materials.set(key, made);
    }
    return materials.get(key);
  }
  for (const g of geometries) {
    const mesh = new T.Mesh(shape(g), material(g.rgba, g.shape === "mesh"));
    mesh.position.fromArray(g.position);
    mesh.quaternion.fromArray(g.quaternion);
    mesh.castShadow = g.rgba[3] > 0.5;
    mesh.receiveShadow = true;
    groups[g.body].add(mesh);
  }

  // ---- marks ---------------------------------------------------------------------------------------
  function ball(color, radius, opacity = 0.9) {
    // Drawn through the robot: the CoM lies inside it.
    const look = new T.MeshBasicMaterial({ color, transparent: true, opacity, depthTest: false });
    const made = new T.Mesh(new T.SphereGeometry(radius, 20, 14), look);
    made.renderOrder = 5;
    scene.add(made);
    return made;
  }
  const polygonLooks = new Map();
  function polygon(vertices, z, color) {
    // Materials are kept: one that nothing uses any more takes its shader along, and compiling is slow.
    if (!polygonLooks.has(color)) {
      const fill = { color, transparent: true, opacity: 0.22, side: T.DoubleSide, depthWrite: false };
      const line = new T.LineBasicMaterial({ color, depthTest: false });
      polygonLooks.set(color, [line, new T.MeshBasicMaterial(fill)]);
    }
    const [line, area] = polygonLooks.get(color);
    const corners = new Float32Array(vertices.flatMap(([x, y]) => [x, y, z]));
    const outline = new T.BufferGeometry();
    outline.setAttribute("position", new T.BufferAttribute(corners, 3));
    const fill = outline.clone();
    const fan = [];
    for (let i = 1; i + 1 < vertices.length; i += 1) fan.push(0, i, i + 1);
    fill.setIndex(fan);
    const made = new T.Group();
    made.add(new T.LineLoop(outline, line), new T.Mesh(fill, area));
    scene.add(made);
    return made;
  }

  // ---- drawing -------------------------------------------------------------------------------------
  // The next picture waits until the graphics are done with the last one: a browser that draws in
  // software would otherwise hold up everything else that the page does.
  const gl = renderer.getContext();
  let pending = false;
  let last = null;
  function busy() {
    if (last !== null && gl.clientWaitSync(last, 0, 0) !== gl.TIMEOUT_EXPIRED) {
      gl.deleteSync(last);
      last = null;
    }
    return last !== null;
  }
  function render() {
    if (busy()) {
      setTimeout(() => requestAnimationFrame(render), 5);
      return;
    }
    pending = false;
    renderer.render(scene, camera);
    last = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }
  function draw() {
    if (!pending) requestAnimationFrame(render);
    pending = true;
  }
  function resize() {
    const { clientWidth: width, clientHeight: tall } = canvas.parentElement;
    if (!width || !tall) return;
    renderer.setSize(width, tall, false);
    camera.aspect = width / tall;
    camera.updateProjectionMatrix();
    draw();
  }
  new ResizeObserver(resize).observe(canvas.parentElement);
  resize();
  controls.addEventListener("change", draw);
  return { scene, camera, controls, groups, follow, ball, polygon, draw };
};
// From base64 to an array's bytes.
window.poiseScene.bytes = (text) => {
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i += 1) out[i] = raw.charCodeAt(i);
  return out.buffer;
};
