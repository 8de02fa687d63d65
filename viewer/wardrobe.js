// The user's character: the agents that walk in its shape, and its bone map.

import { BONES } from "./client/index.js";
import { CharacterFile } from "./character.js";
import { byId, mention } from "./hud.js";

const SIZES = [0.9, 2.2]; // leg length relative to a person's for which a person's steps look well
const FOUND = { vrm: "by VRM's table", names: "by their names", shape: "by its shape", user: "as you chose" };
const REQUIRED = new Set(["pelvis", ...["left", "right"].flatMap((side) => ["hip", "knee", "ankle"].map((bone) => `${side}_${bone}`))]);
const WORDS = { // for bones whose canonical name says little
  hip: "upper leg", knee: "lower leg", ankle: "foot", foot: "toes", collar: "shoulder", shoulder: "upper arm", elbow: "lower arm", wrist: "hand",
};

/** The name of a bone on the page. */
export function boneText(bone) {
  const [, side, part] = /^(?:(left|right)_)?(.*)$/.exec(bone);
  return side ? `${side} ${WORDS[part] ?? part}` : part.replace("pelvis", "hips").replace(/(\d)/, " $1");
}

export class Wardrobe {
  /**
   * `enlist(spec)` makes an agent and resolves to its id; `walk(person)` makes a new person walk;
   * `attempt(action)` wraps what may be refused.
   */
  constructor(api, crowd, { enlist, walk, attempt }) {
    Object.assign(this, { api, crowd, enlist, walk });
    this.look = null;
    this.agentId = null;
    this.take = attempt(this.#take.bind(this));
    this.send = attempt(this.#send.bind(this));
    byId("bones-reset").onclick = () => this.#change((look) => look.reset());
  }

  /** Reads a character's file: it is shown, and made to walk if its bones are known. */
  async #take(file) {
    const look = await CharacterFile.read(await file.arrayBuffer(), file.name);
    this.look = look;
    this.agentId = null;
    this.#list();
    if (look.rescaled !== 1) mention(`${look.title} is in another unit than metres: shown at ${look.rescaled} of its size`);
    await this.#send();
  }

  /** Creates an agent of its proportions, if there is none yet. */
  async #send() {
    const { look } = this;
    if (look.problem || this.agentId) return;
    this.agentId = await this.enlist({ name: look.title.slice(0, 32), ...await this.#shape() });
    this.crowd.dress(this.agentId, look);
    this.walk(this.agentId);
  }

  /** A body with the proportions of the character: nothing but its joints goes to the server. */
  async #shape() {
    try {
      const { gender, betas, scale } = await this.api.fitBody(this.look.joints, this.look.floor);
      if (scale < SIZES[0] || scale > SIZES[1]) {
        mention(`${this.look.title} has ${scale.toFixed(1)} times a person's legs. Live, it takes a person's steps; "wayfarer generate --character" makes its own`);
      }
      return { gender, betas };
    } catch (error) {
      if (error.status !== 404 && error.status !== 405) throw error; // a server that does not have the call
      return { phenotype: { height_m: Math.min(2, Math.max(1.4, this.look.height)) } };
    }
  }

  #change(how) {
    how(this.look);
    this.#list();
    if (this.look.problem) return;
    if (this.agentId) this.crowd.dress(this.agentId, this.look);
    else this.send();
  }

  /** Lists the bones and their nodes, so that the user can correct them. */
  #list() {
    const { look } = this;
    byId("character").hidden = false;
    byId("character-name").textContent = look.title;
    const missing = BONES.filter((bone) => !look.bones.has(bone));
    byId("bones-found").textContent = look.problem
      ? `It cannot walk yet: ${look.problem}`
      : `${look.bones.size} of ${BONES.length} bones found ${FOUND[look.foundBy]}${missing.length ? `; without ${missing.map(boneText).join(", ")}` : ""}`;
    byId("bones-found").dataset.state = look.problem ? "wrong" : "right";
    byId("bones").open ||= Boolean(look.problem);
    byId("bones-list").replaceChildren(...BONES.map((bone) => this.#choice(bone)));
  }

  #choice(bone) {
    const { look } = this;
    const label = document.createElement("label");
    const select = document.createElement("select");
    const node = look.nodeOf(bone);
    const none = new Option(REQUIRED.has(bone) ? "needed" : "none", "", false, !node);
    select.replaceChildren(none, ...look.nodeNames.map((name) => new Option(name, name, false, name === node)));
    select.onchange = () => {
      this.#change(() => look.choose(bone, select.value || null));
      [...byId("bones-list").querySelectorAll("select")][BONES.indexOf(bone)].focus();
    };
    select.dataset.bone = bone;
    if (REQUIRED.has(bone) && !node) select.dataset.state = "missing";
    label.append(boneText(bone), select);
    return label;
  }
}
