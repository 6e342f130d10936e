// Contact forces of one run as arrows, impacts as rings, friction cones.

const CONTACT_STATES = ["open", "frictionless", "stick", "slip"];
const IMPACT_SECONDS = 0.25;

class Arrows {
  constructor(stage, run, number) {
    this.run = run;
    this.number = number;
    this.data = stage.data;
    this.scale = 1;
    this.root = new THREE.Group();
    stage.scene.add(this.root);
    this.cones_visible = false;
    this.colors = { slip: color_of("slip"), stick: color_of("stick") };
    const thickness = 0.010 * stage.data.size;
    this.contacts = run.contacts.names.map((name, k) => {
      const normal = new Arrow(thickness, color_of("normal"));
      const friction = new Arrow(thickness, color_of("stick"));
      const cone = friction_cone(run.contacts.mu[k]);
      const total = new Arrow(thickness, color_of("ink"));
      this.root.add(normal.group, friction.group, total.group, cone);
      return { name, normal, friction, total, cone };
    });
    this.impacts = run.impacts;  // [time, contact, impulse]
    this.impact_times = this.impacts.map((event) => event[0]);
    this.strongest = Math.max(...this.impacts.map((event) => event[2]), 1e-300);
    this.rings = Array.from({ length: this.impacts.length ? 24 : 0 }, () => impact_ring());
    for (const ring of this.rings) this.root.add(ring);
  }

  set_time(time) {
    const { t, contacts } = this.run;
    const n = contacts.names.length;
    const [i, k, s] = neighbours(t, time);
    const scale = this.data.metres_per_newton * this.scale;
    this.carrying = [];
    this.contacts.forEach((contact, c) => {
      const a = i * n + c, b = k * n + c;
      const state = CONTACT_STATES[contacts.state[a]];
      // between two frames that both carry force the force is interpolated, else the earlier one holds
      const share = contacts.state[b] > 0 ? s : 0;
      const point = mixed(contacts.point, a, b, s);
      const normal = mixed(contacts.normal, a, b, 0);
      const force_N = (1 - share) * contacts.la_N[a] + share * contacts.la_N[b];
      const force_F = mixed(contacts.la_F, a, b, share);
      const open = state === "open";
      if (!open) this.carrying.push({ name: contact.name, state, force: force_N, friction: force_F.length() });
      const along_N = normal.clone().multiplyScalar(open ? 0 : force_N * scale);
      const along_F = force_F.multiplyScalar(open ? 0 : scale);
      const color = state === "slip" ? this.colors.slip : this.colors.stick;
      contact.friction.recolor(color);
      contact.cone.visible = this.cones_visible && !open && this.run.contacts.mu[c] > 0;
      if (contact.cone.visible) {
        contact.cone.position.copy(point);
        contact.cone.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), normal);
        contact.cone.scale.setScalar(along_N.length());
        contact.cone.children.forEach((part) => part.material.color.set(color));
      }
      contact.total.set(point, contact.cone.visible ? along_N.clone().add(along_F) : new THREE.Vector3());
      contact.normal.set(point, along_N);
      contact.friction.set(point, along_F);
    });
    this.show_impacts(time);
  }

  // Rings around the points of the last impacts: they grow and fade within a quarter of a second.
  show_impacts(time) {
    const last = this.impact_times.length && this.impact_times[0] <= time ? index_before(this.impact_times, time) : -1;
    this.rings.forEach((ring, n) => {
      const event = this.impacts[last - n];
      const age = event ? (time - event[0]) / IMPACT_SECONDS : 1;
      ring.visible = age < 1;
      if (!ring.visible) return;
      const { t, contacts } = this.run;
      const row = index_before(t, event[0] + 1e-6) * contacts.names.length + event[1];
      ring.position.copy(mixed(contacts.point, row, row, 0));
      ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), mixed(contacts.normal, row, row, 0));
      const strength = Math.cbrt(event[2] / this.strongest);
      ring.scale.setScalar(0.30 * this.data.size * strength * (0.25 + 0.75 * Math.sqrt(age)));
      ring.material.opacity = 0.9 * (1 - age) ** 1.5;
    });
  }
}

function mixed(array, a, b, s) {
  return new THREE.Vector3(...[0, 1, 2].map((n) => (1 - s) * array[3 * a + n] + s * array[3 * b + n]));
}

// An arrow that is solid where it is seen; inside a body it shines through, with a light edge around it.
class Arrow {
  constructor(thickness, color) {
    this.thickness = thickness;
    this.group = new THREE.Group();
    const through = { depthTest: false, depthWrite: false, transparent: true };
    const edge = new THREE.MeshBasicMaterial({ ...through, color: 0xffffff, opacity: 0.5 });
    this.materials = [
      new THREE.MeshBasicMaterial({ ...through, opacity: 0.72 }),
      new THREE.MeshLambertMaterial({ emissiveIntensity: 0.38, transparent: true }),
    ];
    this.parts = [edge, ...this.materials].map((material, n) => {
      const shaft = new THREE.Mesh(Arrow.shaft, material), head = new THREE.Mesh(Arrow.head, material);
      shaft.renderOrder = head.renderOrder = 4 + n;
      this.group.add(shaft, head);
      return { shaft, head, margin: n === 0 ? 0.35 : 0 };
    });
    this.recolor(color);
  }

  recolor(color) {
    if (color === this.color) return;
    this.color = color;
    for (const material of this.materials) {
      material.color.set(color);
      if (material.emissive) material.emissive.set(color);
    }
  }

  set(point, vector) {
    const length = vector.length();
    const head_length = Math.min(4.2 * this.thickness, 0.6 * length);
    this.group.visible = length > 0.4 * this.thickness;
    if (!this.group.visible) return;
    this.group.position.copy(point);
    this.group.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), vector.normalize());
    const width = this.thickness * Math.min(1, 0.35 + (0.65 * head_length) / (4.2 * this.thickness));
    for (const { shaft, head, margin } of this.parts) {
      const edge = margin * width;
      shaft.scale.set(width + edge, length - 0.9 * head_length, width + edge);
      head.scale.set(2.5 * width + 1.6 * edge, head_length + 2.5 * edge, 2.5 * width + 1.6 * edge);
      head.position.y = length - head_length - edge;
    }
  }
}
Arrow.shaft = new THREE.CylinderGeometry(1, 1, 1, 20).translate(0, 0.5, 0);
Arrow.head = new THREE.ConeGeometry(1, 1, 24).translate(0, 0.5, 0);

function impact_ring() {
  const material = new THREE.MeshBasicMaterial({
    color: color_of("impact"), transparent: true, side: THREE.DoubleSide, depthTest: false, depthWrite: false,
  });
  const ring = new THREE.Mesh(new THREE.RingGeometry(0.86, 1, 64), material);
  ring.renderOrder = 3;
  ring.visible = false;
  return ring;
}

// The cone |f_F| <= mu f_N with its tip at the origin, along y, of height 1.
function friction_cone(mu) {
  const group = new THREE.Group();
  const surface = new THREE.ConeGeometry(mu, 1, 48, 1, true).rotateX(Math.PI).translate(0, 0.5, 0);
  const glass = { transparent: true, opacity: 0.22, side: THREE.DoubleSide, depthWrite: false };
  const rim_points = Array.from({ length: 65 }, (_, n) => (n * Math.PI) / 32);
  const circle = rim_points.map((angle) => new THREE.Vector3(mu * Math.cos(angle), 1, mu * Math.sin(angle)));
  group.add(new THREE.Mesh(surface, new THREE.MeshBasicMaterial(glass)));
  group.add(new THREE.Line(new THREE.BufferGeometry().setFromPoints(circle), new THREE.LineBasicMaterial()));
  group.visible = false;
  return group;
}
