/** Drags meshes as the page does: JSON cases on standard input, positions on standard output. */
import { readFileSync } from "node:fs";
import { Puppet } from "../../proxyimg_codec/studio/page/arap.js";

const cases = JSON.parse(readFileSync(0, "utf8"));
const results = cases.map((c) => {
  const puppet = new Puppet(c.nodes.flat(), c.triangles.flat(), c.points.flat(), c.rest.flat());
  puppet.drag(c.points.flat()); // what a drag leaves behind must not change the next one
  return Array.from(puppet.drag(c.targets.flat()));
});
console.log(JSON.stringify(results));
