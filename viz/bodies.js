// The bodies of one run: a group per joint that moves with the clock, and the geometries inside it.

class Bodies {
  constructor(stage, run, number) {
    this.run = run;
    this.number = number;
    this.root = new THREE.Group();
    this.root.name = run.label;
    stage.scene.add(this.root);
    this.joints = Array.from({ length: run.joints }, () => new THREE.Group());
    this.root.add(...this.joints);
    this.ready = Promise.all(run.objects.map((object, n) => this.add_object(stage, object, [`run${number}`, `${n}`])));
    this.tubes = new Tubes(this.root, run);
    this.add_trace(stage.data.size);
    this.add_axes(stage.data.size);
  }

  // meshcat builds the object, at once or when its textures are there; its node moves to the group of its joint.
  async add_object({ viewer }, description, path) {
    const built = new Promise((resolve) => viewer.on_object.set(path.join("/"), resolve));
    viewer.set_object_from_json(path, description.object);
    const node = viewer.scene_tree.find(path).object;
    const matrix = new THREE.Matrix4().fromArray(description.matrix);
    matrix.decompose(node.position, node.quaternion, node.scale);
    node.name = description.name;
    this.joints[description.joint].add(node);
    (await built).traverse((mesh) => {
      if (mesh.isMesh) this.finish(mesh, description);
    });
    viewer.set_dirty();
  }

  finish(mesh, description) {
    const tint = this.run.tint;
    mesh.castShadow = mesh.receiveShadow = true;
    if (tint) {
      const material = new THREE.MeshPhongMaterial({
        color: new THREE.Color(...tint), opacity: tint[3], transparent: true, side: THREE.FrontSide,
      });
      mesh.material = material;
      mesh.castShadow = false;
    } else if (mesh.geometry.type === "SphereGeometry" && !description.hollow) {
      mesh.material.map = beach_ball();
    }
    if (description.hollow) {
      mesh.castShadow = false;
      mesh.material.side = THREE.BackSide;
      const lines = new THREE.LineBasicMaterial({ color: 0x44525f, transparent: true, opacity: 0.45 });
      mesh.add(new THREE.LineSegments(rim(mesh.geometry), lines));
    }
  }

  add_trace(size) {
    const { com } = this.run;
    this.trace = new THREE.Group();
    const color = new THREE.Color(...(this.run.tint || [0.54, 0.35, 0]).slice(0, 3));
    const points = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(com, 3));
    this.trace.add(new THREE.Line(points, new THREE.LineBasicMaterial({ color })));
    const see_through = { color, depthTest: false, transparent: true };
    this.mark = new THREE.Mesh(new THREE.SphereGeometry(0.018 * size, 20, 14), new THREE.MeshBasicMaterial(see_through));
    this.mark.renderOrder = 5;
    this.trace.add(this.mark);
    this.trace.visible = false;
    this.root.add(this.trace);
    this.com = new THREE.Vector3();
  }

  // The frame of every joint, that of the world among them: x red, y green, z blue.
  add_axes(size) {
    this.axes = this.joints.map((joint) => {
      const axes = new THREE.AxesHelper(0.14 * size);
      axes.material.depthTest = false;
      axes.renderOrder = 6;
      axes.visible = false;
      joint.add(axes);
      return axes;
    });
  }

  show_axes(on) { for (const axes of this.axes) axes.visible = on; }

  set_time(time) {
    this.tubes.set_time(time);
    const { t, pose, com } = this.run;
    const [i, k, s] = neighbours(t, time);
    const width = 7 * this.joints.length;
    const other = new THREE.Quaternion();
    this.joints.forEach((joint, j) => {
      const a = i * width + 7 * j, b = k * width + 7 * j;
      for (const [n, axis] of ["x", "y", "z"].entries()) joint.position[axis] = (1 - s) * pose[a + n] + s * pose[b + n];
      joint.quaternion.fromArray(pose, a + 3);
      if (k > i) joint.quaternion.slerp(other.fromArray(pose, b + 3), s);
    });
    this.com.set(...[0, 1, 2].map((n) => (1 - s) * com[3 * i + n] + s * com[3 * k + n]));
    this.mark.position.copy(this.com);
  }
}

// A pattern that shows how a ball turns; it only darkens the ball's own colour.
function beach_ball() {
  if (!beach_ball.texture) {
    const canvas = make("canvas", { width: 8, height: 4 });
    const pen = canvas.getContext("2d");
    for (let x = 0; x < 8; x++) {
      for (let y = 0; y < 4; y++) {
        pen.fillStyle = (x + (y >> 1)) % 2 ? "#ffffff" : "#b4b9bf";
        pen.fillRect(x, y, 1, 1);
      }
    }
    beach_ball.texture = new THREE.CanvasTexture(canvas);
    beach_ball.texture.magFilter = THREE.NearestFilter;
    beach_ball.texture.minFilter = THREE.LinearFilter;
  }
  return beach_ball.texture;
}

// Lines on a hollow shape: the edges of a tube and some of its generators, parallels and meridians of a sphere.
function rim(geometry) {
  const points = [];
  const ring = (at) => {
    for (let n = 0; n < 96; n++) points.push(at((n * Math.PI) / 48), at(((n + 1) * Math.PI) / 48));
  };
  const { radius, radiusTop, height } = geometry.parameters;
  if (geometry.type === "CylinderGeometry") {
    const at = (angle, y) => new THREE.Vector3(radiusTop * Math.cos(angle), y, radiusTop * Math.sin(angle));
    for (const y of [-height / 2, height / 2]) ring((angle) => at(angle, y));
    for (let n = 0; n < 24; n++) points.push(at((n * Math.PI) / 12, -height / 2), at((n * Math.PI) / 12, height / 2));
  } else {
    for (let n = 1; n < 6; n++) {
      const r = radius * Math.sin((n * Math.PI) / 6), y = radius * Math.cos((n * Math.PI) / 6);
      ring((angle) => new THREE.Vector3(r * Math.cos(angle), y, r * Math.sin(angle)));
      const c = Math.cos((n * Math.PI) / 6), s = Math.sin((n * Math.PI) / 6);
      ring((angle) => new THREE.Vector3(radius * c * Math.cos(angle), radius * Math.sin(angle), radius * s * Math.cos(angle)));
    }
  }
  return new THREE.BufferGeometry().setFromPoints(points);
}
