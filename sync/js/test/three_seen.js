// What is seen of a replica of rtsg/three, as text; for tests that compare one that followed with one that was built from scratch.
import assert from 'node:assert/strict';

import * as three from 'three';

/** All that is seen of a replica, in an order that does not depend on how it came about. */
export function seen(replica) {
  const numbers = (list) => Array.from(list, (x) => +x.toFixed(4));
  const material = ({type, color, emissive, opacity, side, map}) => ({type, color: color && numbers(color.toArray()), emissive: emissive && numbers(emissive.toArray()), opacity, side, map: Boolean(map)});
  const walk = (object, above) => {
    const matrix = new three.Matrix4().multiplyMatrices(above, object.matrix), own = [];
    if (object.isLeaf && object.geometry.attributes.position) {
      own.push(JSON.stringify({id: object.userData.id, at: numbers(matrix.elements), material: material(object.material),
        position: numbers(object.geometry.attributes.position.array), color: numbers(object.geometry.attributes.color?.array ?? [])}));
    } else if (object.isLight) {
      own.push(JSON.stringify({id: object.userData.id, at: numbers(matrix.elements), color: numbers(object.color.toArray()), intensity: object.intensity}));
    }
    return own.concat((object.userData.children ?? []).flatMap((child) => walk(child, matrix)));
  };
  return walk(replica.top, new three.Matrix4()).sort();
}
/** Where batches draw their meshes is where these are. */
export function assertBatches(replica) {
  for (const {mesh, meshes} of replica.batches.values()) {
    if (!mesh) continue;
    assert.equal(mesh.count, meshes.length);
    meshes.forEach((each, i) => {
      const at = new three.Matrix4();
      for (let up = each; up !== replica; up = up.parent) at.premultiply(up.matrix);
      at.elements.forEach((x, k) => assert.ok(Math.abs(x - mesh.instanceMatrix.array[16 * i + k]) < 1e-4 * (1 + Math.abs(x))));
      assert.equal(each.visible, false);
    });
  }
}
