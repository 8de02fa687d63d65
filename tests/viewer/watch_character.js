// Measures the character on the page while it walks: frames into `seen`. The expression's value: vertices of
// each foot.
(() => {
  const person = wayfarer.crowd.people.find((found) => found.body?.character);
  const { object, character } = person.body;
  const { retarget, map: { rig, bones } } = character;
  const nodes = new Map();
  object.traverse((node) => nodes.set(node.userData.name ?? node.name, node));
  const place = (bone) => nodes.get(rig.nodes[bones.get(bone)].name).matrixWorld.elements.slice(12, 15);
  const feet = ["left_ankle", "right_ankle"].map((bone) => {
    const top = bones.get(bone);
    const names = rig.nodes.flatMap(({ name }, k) => (k === top || rig.ancestors(k).includes(top) ? [name] : []));
    const found = [];
    object.traverse((mesh) => {
      if (!mesh.isSkinnedMesh) return;
      const { skinIndex, skinWeight } = mesh.geometry.attributes;
      for (let vertex = 0; vertex < skinIndex.count; vertex += 1) {
        const weights = [0, 1, 2, 3].map((k) => skinWeight.getComponent(vertex, k));
        const joint = mesh.skeleton.bones[skinIndex.getComponent(vertex, weights.indexOf(Math.max(...weights)))];
        if (names.includes(joint.userData.name ?? joint.name)) found.push([mesh, vertex]);
      }
    });
    return found;
  });
  const limbs = ["left", "right"].flatMap((side) => [
    ["hip", "knee"], ["knee", "ankle"], ["shoulder", "elbow"], ["elbow", "wrist"],
  ].map((ends) => ends.map((end) => `${side}_${end}`)));
  const BONES = [...bones.keys()];
  const number = (bone) => wayfarer.bones.indexOf(bone);
  const agents = (bone) => [...retarget.source.slice(3 * number(bone), 3 * number(bone) + 3)];
  const thighs = (at) => (at("left_hip")[1] + at("right_hip")[1]) / 2;
  const angle = ([from, to]) => {
    const way = (at) => [0, 1, 2].map((n) => at(to)[n] - at(from)[n]);
    const [a, b] = [way(place), way(agents)];
    return Math.acos(Math.min(1, a.reduce((sum, value, n) => sum + value * b[n], 0) / (Math.hypot(...a) * Math.hypot(...b))));
  };
  const spot = person.marker.position.clone();
  const lowest = (list) => Math.min(...list.map(([mesh, vertex]) => {
    mesh.getVertexPosition(vertex, spot);
    return spot.applyMatrix4(mesh.matrixWorld).y;
  }));
  globalThis.seen = [];
  const pose = person.pose.bind(person);
  person.pose = (frame) => {
    pose(frame);
    if (person.played.state !== "walking" || seen.length >= 400) return;
    object.updateMatrixWorld(true);
    const { contacts } = person.played.track;
    // heights of the soles of the agent; as its contact ends, a foot is on its way up
    const soles = [...retarget.clear];
    const ground = Math.min(...soles);
    seen.push({
      stance: feet.flatMap((list, leg) => (
        contacts & (1 << leg) ? [lowest(list) - ground - retarget.ratio * (soles[leg] - ground)] : []
      )),
      ground: ground - person.y,
      hips: (thighs(place) - person.y) / (retarget.ratio * (thighs(agents) - person.y)) - 1,
      turned: Math.max(...limbs.filter((ends) => ends.every((end) => bones.has(end))).map(angle)),
      upright: place("head")[1] - place("pelvis")[1],
    });
  };
  return feet.map(({ length }) => length);
})()
