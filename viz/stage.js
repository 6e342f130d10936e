const THREE = MeshCat.THREE;

// The viewer with its light, ground and camera. World coordinates are z up; meshcat's camera lives y up.

class Stage {
  constructor(pane, data) {
    this.data = data;
    this.pane = pane;
    this.viewer = new MeshCat.Viewer(pane, false);
    const resize = this.viewer.set_3d_pane_size;
    this.viewer.set_3d_pane_size = () => resize.call(this.viewer, pane.clientWidth, pane.clientHeight);
    new ResizeObserver(() => this.viewer.set_3d_pane_size()).observe(pane);
    this.announce_objects();
    this.viewer.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.viewer.set_3d_pane_size();
    for (const name of ["Grid", "Axes", "Lights"]) this.viewer.set_property([name], "visible", false);
    this.viewer.set_property(["Background"], "top_color", [0.80, 0.86, 0.92]);
    this.viewer.set_property(["Background"], "bottom_color", [0.965, 0.975, 0.985]);
    this.motion = data.motion.map((corner) => new THREE.Vector3(...corner));
    this.start = data.start.map((corner) => new THREE.Vector3(...corner));
    this.span = Math.max(this.motion[0].distanceTo(this.motion[1]), 1e-3);
    this.followed = new THREE.Vector3();
    this.follows = data.follow;
    this.add_light();
    this.look("home");
  }

  // What the camera frames and the light covers: the whole motion, or the system with some room around it.
  get frame() {
    if (!this.follows) return this.motion;
    const room = this.start[1].clone().sub(this.start[0]).multiplyScalar(0.3);
    return [this.start[0].clone().sub(room), this.start[1].clone().add(room)];
  }

  get center() { return this.frame[0].clone().add(this.frame[1]).multiplyScalar(0.5).add(this.followed); }

  get scene() { return this.viewer.scene; }

  // Objects with textures arrive later: whoever waits in `on_object` for a path is called with the object.
  announce_objects() {
    const set_object = this.viewer.set_object;
    this.viewer.on_object = new Map();
    this.viewer.set_object = (path, object) => {
      set_object.call(this.viewer, path, object);
      const waiting = this.viewer.on_object.get(path.join("/"));
      if (waiting) waiting(object);
    };
  }

  add_light() {
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb9c0c8, 0.62));
    this.sun = new THREE.DirectionalLight(0xffffff, 0.62);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.bias = -0.0005;
    this.sun.shadow.normalBias = 0.0012 * this.span;
    this.aim_light();
    const back = new THREE.DirectionalLight(0xffffff, 0.16);
    back.position.set(1, 0.8, 0.3);
    this.scene.add(this.sun, this.sun.target, back);
  }

  aim_light() {
    const { sun, center } = this, span = Math.max(this.frame[0].distanceTo(this.frame[1]), 1e-3);
    sun.position.copy(center).add(new THREE.Vector3(-0.5, -0.85, 1.1).multiplyScalar(1.4 * span));
    sun.target.position.copy(center);
    const reach = 0.75 * span;
    Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
    Object.assign(sun.shadow.camera, { near: 0.1 * span, far: 4 * span });
    sun.shadow.camera.updateProjectionMatrix();
  }

  add_planes(planes, bodies) {
    for (const plane of planes) {
      const parent = plane.joint ? bodies[plane.run].joints[plane.joint] : this.scene;
      parent.add(...plane_meshes(plane));
    }
  }

  // Look from a named direction so that the box of the motion fills the view.
  look(name) {
    const directions = { home: [0.50, -1, 0.36], front: [0, -1, 0.02], side: [1, 0, 0.02], top: [0, -0.001, 1] };
    const direction = new THREE.Vector3(...directions[name]).normalize();
    this.place_camera(direction, this.fitting_distance(direction));
  }

  place_camera(direction, distance) {
    const { camera, controls } = this.viewer;
    camera.near = distance / 200;
    camera.far = distance * 60 + 40 * this.span;
    camera.fov = 40;
    camera.updateProjectionMatrix();
    const target = this.center;
    camera.position.copy(y_up(target.clone().addScaledVector(direction, distance)));
    controls.target.copy(y_up(target));
    controls.update();
    this.viewer.set_dirty();
  }

  fitting_distance(direction) {
    const [low, high] = this.frame, middle = low.clone().add(high).multiplyScalar(0.5);
    const up = new THREE.Vector3(0, 0, 1);
    const right = new THREE.Vector3().crossVectors(up, direction).normalize();
    up.crossVectors(direction, right);
    const tan_y = Math.tan((40 * Math.PI) / 360);
    const tan_x = tan_y * Math.max(this.pane.clientWidth / Math.max(this.pane.clientHeight, 1), 0.3);
    let distance = 0;
    for (let n = 0; n < 8; n++) {
      const corner = new THREE.Vector3(
        n & 1 ? high.x : low.x, n & 2 ? high.y : low.y, n & 4 ? high.z : low.z,
      ).sub(middle);
      const needed = Math.max(Math.abs(corner.dot(right)) / tan_x, Math.abs(corner.dot(up)) / tan_y);
      distance = Math.max(distance, corner.dot(direction) + needed * 1.18);
    }
    return Math.max(distance, 0.3 * low.distanceTo(high));
  }

  // The camera goes where the system goes; `shift` is the way of its centre of mass since the start.
  follow(shift) {
    const step = y_up((this.follows ? shift : this.followed).clone().sub(this.followed));
    this.viewer.camera.position.add(step);
    this.viewer.controls.target.add(step);
    if (this.follows) this.followed.copy(shift);
    this.aim_light();
  }

  set_follow(on) {
    this.follows = on;
    if (!on) this.followed.set(0, 0, 0);
  }

  pixels_per_metre() {
    const { camera, controls } = this.viewer;
    const distance = camera.position.distanceTo(controls.target);
    return this.pane.clientHeight / (2 * Math.tan((camera.fov * Math.PI) / 360) * distance);
  }

  render() { this.viewer.render(); }
}

function y_up(v) { return new THREE.Vector3(v.x, v.z, -v.y); }

const GROUND_VERTEX = `
  varying vec2 on_plane;
  attribute vec2 plane_position;
  void main() {
    on_plane = plane_position;
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;

const GROUND_FRAGMENT = `
  varying vec2 on_plane;
  uniform float cell, radius;
  float lines(float spacing, float width) {
    vec2 x = on_plane / spacing;
    vec2 blur = max(fwidth(x), vec2(1e-6));
    vec2 d = abs(fract(x - 0.5) - 0.5) / blur;
    float line = 1.0 - min(min(d.x, d.y) / width, 1.0);
    return line * clamp(0.5 / max(blur.x, blur.y) - 0.6, 0.0, 1.0);
  }
  void main() {
    float fade = 1.0 - smoothstep(0.35 * radius, 0.98 * radius, length(on_plane));
    float ink = max(0.16 * lines(cell, 1.2), 0.34 * lines(5.0 * cell, 1.5));
    gl_FragColor = vec4(mix(vec3(0.93, 0.942, 0.952), vec3(0.30, 0.38, 0.46), ink), fade);
  }`;

// The piece of a half-space: a grid that fades out, and a surface that takes shadows; from within the material one sees through.
function plane_meshes(plane) {
  const axes = plane.axes.map((axis) => new THREE.Vector3(...axis));
  const center = new THREE.Vector3(...plane.center);
  const corners = plane.polygon.map((corner) => new THREE.Vector3(...corner));
  const geometry = new THREE.BufferGeometry().setFromPoints(corners);
  const flat = corners.flatMap((corner) => axes.map((axis) => corner.clone().sub(center).dot(axis)));
  geometry.setAttribute("plane_position", new THREE.Float32BufferAttribute(flat, 2));
  const normals = corners.flatMap(() => plane.normal);
  geometry.setAttribute("normal", new THREE.Float32BufferAttribute(normals, 3));
  geometry.setIndex(corners.slice(2).flatMap((_, n) => [0, n + 1, n + 2]));
  const uniforms = { cell: { value: plane.cell }, radius: { value: plane.radius } };
  const material = new THREE.ShaderMaterial({
    uniforms, vertexShader: GROUND_VERTEX, fragmentShader: GROUND_FRAGMENT, transparent: true, depthWrite: false,
    side: THREE.FrontSide, extensions: { derivatives: true },
  });
  const grid = new THREE.Mesh(geometry, material);
  grid.renderOrder = -2;
  const shade = new THREE.ShadowMaterial({ opacity: 0.26, depthWrite: false, polygonOffset: true });
  shade.polygonOffsetFactor = shade.polygonOffsetUnits = -1;
  const shadow = new THREE.Mesh(geometry, shade);
  shadow.receiveShadow = true;
  shadow.renderOrder = -1;
  grid.name = `plane ${plane.name}`;
  return [grid, shadow];
}
