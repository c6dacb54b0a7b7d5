/** A picture that was read: its layers at rest. Rasters are decoded when they are needed (SEC-8). */

import { REST, readFile } from "./chunks.js";
import { readChunks } from "./container.js";
import { decodeBoundary } from "./geometry.js";
import { decodeNetwork, decodePlane } from "./implicit.js";
import { decodeLatents } from "./latents.js";
import { decodeMesh } from "./mesh.js";
import { decodeModel } from "./model.js";
import { Motion } from "./motion.js";
import { displacements } from "./pose.js";
import { synthesize } from "./synthesis.js";
import { viewOf } from "./view.js";
import { Budget, LIMITS } from "./limits.js";

/** Models by their bytes: several pictures share what was decoded of them. */
const models = new WeakMap();

function modelOf(bytes) {
  if (!models.has(bytes)) models.set(bytes, decodeModel(bytes));
  return models.get(bytes);
}

export class Image {
  #cache = new Map();

  /**
   * Reads and checks a file; throws PxiError.
   *
   * `loadModel(number)` promises the bytes of a registered model (MODEL_FILES says where they are).
   */
  static async open(bytes, loadModel, limits = {}) {
    const image = new Image(bytes, new Budget({ ...LIMITS, ...limits }));
    for (const { model } of image.plans) {
      if (!image.models.has(model)) image.models.set(model, modelOf(await loadModel(model)));
    }
    return image;
  }

  constructor(bytes, limits) {
    const file = readFile(readChunks(bytes, limits), limits);
    this.limits = limits;
    this.models = new Map();
    const { head, layers, poses, networks, plans, textures } = file;
    Object.assign(this, { head, layers, poses, plans, textures });
    [this.width, this.height] = head.size;
    this.boundaries = layers.map(decodeBoundary);
    this.networks = networks.map(decodeNetwork);
    this.meshes = new Map([...file.meshes].map(([k, mesh]) => [k, decodeMesh(mesh, limits)]));
    this.moved = this.#displacements("node");
    this.places = this.#displacements("place");
    textures.forEach(({ coder }, k) => coder === 1 && this.plane(k));
    this.motion = file.motion ? new Motion(file.motion, this.meshes, limits) : null;
  }

  #displacements(kind) {
    return new Map([...this.poses].map(([k, pose]) => {
      return [k, displacements(pose, kind, this.meshes.get(k))];
    }));
  }

  /** Names and visibility of the layers, back to front. */
  get names() {
    return this.layers.map(({ name }, k) => ({ name, hidden: Boolean(this.pose(k).hidden) }));
  }

  pose(k) {
    return this.poses.get(k) ?? REST;
  }

  /** The number of the texture that layer n shows. */
  source(n) {
    return this.textures[n].coder === 0 ? this.textures[n].texture : n;
  }

  #once(key, make) {
    if (!this.#cache.has(key)) this.#cache.set(key, make());
    return this.#cache.get(key);
  }

  /** The plane of codes of implicit texture k. */
  plane(k) {
    return this.#once(`plane ${k}`, () => {
      const { dim } = this.networks[this.textures[k].network];
      return decodePlane(this.textures[k], this.layers[k].sampling === 1 ? dim / 2 : dim);
    });
  }

  /** All latents of a PLAN. */
  latents(number) {
    const plan = this.plans[number];
    return decodeLatents(plan, this.models.get(plan.model));
  }

  /** The samples of a PLAN. */
  raster(number) {
    return this.#once(`raster ${number}`, () => {
      const plan = this.plans[number];
      return synthesize(plan, this.latents(number), this.models.get(plan.model));
    });
  }

  /**
   * What layer n shows of its raster, the last one of which is kept.
   *
   * `moving` tells whether it is the picture at a time, `drawn` are the numbers of all layers that
   * are drawn.
   */
  view(n, moving, drawn) {
    const k = this.source(n);
    if (!this.textures[k].cuts.length) {
      return this.#once(`view of ${k}`, () => this.#viewOf(n, k, moving, drawn));
    }
    const key = `${moving} ${drawn}`;
    const last = this.#cache.get(`view ${n}`);
    if (last?.key === key) return last.view;
    const view = this.#viewOf(n, k, moving, drawn);
    this.#cache.set(`view ${n}`, { key, view });
    return view;
  }

  #viewOf(n, k, moving, drawn) {
    const { layers, textures, plans, poses, boundaries, limits, motion } = this;
    const bodies = new Map(moving ? motion.layers.map((l, i) => [l, motion.bodies[i]]) : []);
    const scene = { layers, textures, plans, poses, boundaries, limits, bodies, drawn };
    return viewOf(scene, n, k, (number) => this.raster(number));
  }
}
