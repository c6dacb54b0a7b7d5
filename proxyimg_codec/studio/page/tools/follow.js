/** The inside of a layer that goes along with a point of its outline, as `point` with `follow` does it. */
import { Puppet, attach } from "../arap.js";
import { sampled, shares } from "../bezier.js";
import * as scene from "../scene.js";

/** Most points of the outline that stay where they are. */
const HELD_MAX = 120;

/**
 * Prepares to bend a layer so that its outline follows one control point, and the rest of it stays.
 * @param {string} name @param {number[][][]} paths present outline @param {number} path @param {number} point
 * @returns {((dx: number, dy: number) => void) | null} bends for a displacement; null without a mesh
 */
export function follower(name, paths, path, point) {
  const mesh = scene.mesh(name);
  if (!mesh) return null;
  const nodes = scene.present(name, mesh), corners = (/** @type {number} */ t) => [0, 1, 2].map((i) => mesh.faces[3 * t + i]);
  const found = paths.flatMap((p, i) => {
    const points = sampled(p), share = i === path ? shares(p, point) : null;
    return Array.from({ length: points.length / 2 }, (_, k) => ({ x: points[2 * k], y: points[2 * k + 1], share: share?.[k] ?? 0, triangle: attach(nodes, mesh.faces, points[2 * k], points[2 * k + 1]).triangle }));
  });
  const first = found.reduce((a, b) => (b.share > a.share ? b : a)), near = new Set(corners(first.triangle));
  const held = found.filter((q) => !corners(q.triangle).some((n) => near.has(n)));
  const still = held.filter((q) => q.share === 0), step = Math.max(1, Math.ceil(still.length / HELD_MAX));
  const handles = [first, ...held.filter((q) => q.share > 0), ...still.filter((_, i) => i % step === 0)];
  const puppet = new Puppet(nodes, mesh.faces, handles.flatMap((q) => [q.x, q.y]), scene.present(name, mesh, mesh.nodes));
  return (dx, dy) => scene.bend(name, puppet.drag(handles.flatMap((q) => [q.x + q.share * dx, q.y + q.share * dy]), { milliseconds: 12, rounds: 2, warm: true }));
}
