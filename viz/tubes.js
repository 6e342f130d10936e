// The deforming bodies of one run: tubes around centrelines, whose surfaces are drawn anew at every moment.

const TUBE_SIDES = 16;

class Tubes {
  constructor(parent, run) {
    this.run = run;
    this.tubes = run.tubes.map((tube) => new Tube(tube, run.tint));
    for (const { mesh } of this.tubes) parent.add(mesh);
  }

  set_time(time) {
    const { t } = this.run;
    const [i, k, s] = neighbours(t, time);
    for (const tube of this.tubes) tube.set(i, k, s);
  }
}

class Tube {
  constructor({ name, points, count, radius, color }, tint) {
    Object.assign(this, { points, count, radius });
    // the rings of the wall, then for each end a ring with the normal of the end and its middle
    const total = (count + 2) * TUBE_SIDES + 2;
    this.geometry = new THREE.BufferGeometry();
    for (const key of ["position", "normal"]) {
      const attribute = new THREE.BufferAttribute(new Float32Array(3 * total), 3);
      attribute.setUsage(THREE.DynamicDrawUsage);
      this.geometry.setAttribute(key, attribute);
    }
    this.geometry.setIndex(tube_faces(count));
    const [r, g, b, opacity] = tint || color;
    const material = new THREE.MeshPhongMaterial({ color: new THREE.Color(r, g, b), opacity, transparent: opacity < 1 });
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.name = name;
    this.mesh.castShadow = !tint;
    this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false;  // it moves out of the sphere around its first shape
  }

  // The shape between the frames i and k, at the share s.
  set(i, k, s) {
    const { count, points } = this;
    const line = Array.from({ length: count }, (_, n) => mixed(points, i * count + n, k * count + n, s));
    const { position, normal } = this.geometry.attributes;
    const tangent = new THREE.Vector3(), other = new THREE.Vector3(), spoke = new THREE.Vector3();
    let across = null;
    const ring = (n, row, facing) => {
      for (let side = 0; side < TUBE_SIDES; side++) {
        const angle = (2 * Math.PI * side) / TUBE_SIDES, at = row * TUBE_SIDES + side;
        spoke.copy(across).multiplyScalar(Math.cos(angle)).addScaledVector(other, Math.sin(angle));
        const outward = facing || spoke;
        normal.setXYZ(at, outward.x, outward.y, outward.z);
        spoke.multiplyScalar(this.radius).add(line[n]);
        position.setXYZ(at, spoke.x, spoke.y, spoke.z);
      }
    };
    const cap = (n, row, direction) => {
      const facing = tangent.clone().multiplyScalar(direction), middle = (count + 2) * TUBE_SIDES + row - count;
      ring(n, row, facing);
      position.setXYZ(middle, line[n].x, line[n].y, line[n].z);
      normal.setXYZ(middle, facing.x, facing.y, facing.z);
    };
    for (let n = 0; n < count; n++) {
      tangent.copy(line[Math.min(n + 1, count - 1)]).sub(line[Math.max(n - 1, 0)]).normalize();
      if (!across) across = least_axis(tangent);
      across.addScaledVector(tangent, -tangent.dot(across)).normalize();
      other.crossVectors(tangent, across);
      ring(n, n, null);
      if (n === 0) cap(0, count, -1);
      if (n === count - 1) cap(n, count + 1, 1);
    }
    position.needsUpdate = normal.needsUpdate = true;
  }
}

// The axis of the world that a direction is farthest from.
function least_axis(direction) {
  const size = direction.toArray().map(Math.abs), axis = size.indexOf(Math.min(...size));
  return new THREE.Vector3().setComponent(axis, 1);
}

function tube_faces(count) {
  const faces = [];
  for (let side = 0; side < TUBE_SIDES; side++) {
    const next = (side + 1) % TUBE_SIDES;
    for (let n = 0; n < (count - 1) * TUBE_SIDES; n += TUBE_SIDES) {
      faces.push(n + side, n + next, n + TUBE_SIDES + next, n + side, n + TUBE_SIDES + next, n + TUBE_SIDES + side);
    }
    const [first, last, middle] = [count, count + 1, count + 2].map((row) => row * TUBE_SIDES);
    faces.push(middle, first + next, first + side, middle + 1, last + side, last + next);
  }
  return faces;
}
