// The scene panel: chooses a scene, makes one from a file, describes it.

import { byId, tell } from "./hud.js";
import { Level } from "./scene_level.js";
import { choicesOf, meshFormat, SceneBook } from "./scenes.js";

const POLL_SECONDS = 1.5;

export class ScenePanel {
  /**
   * `enter(sceneId)` begins a session in a scene. `chosen()` is called when the user's choice of a scene is open, `changed()` when the
   * scene's ground or obstacles have changed. `attempt(action)` wraps actions that may be refused.
   */
  constructor(api, stage, { enter, chosen, changed, attempt }) {
    Object.assign(this, { api, stage, enter, changed });
    this.level = new Level();
    this.book = new SceneBook(api, {
      changed: (outlines) => this.#show(outlines),
      moved: (obstacles) => this.level.showObstacles(obstacles),
      gone: () => {}, // the session is gone, too, and the page says so
      failed: (error) => error.status && tell(error.message), // without an answer the connection is lost, which is shown
    });
    this.choices = [];
    this.value = null; // of the choice that was entered
    this.file = null; // of the level that the user brought: { id, bytes, format, name }
    this.begun = false; // whether the page has been welcomed
    this.fresh = false; // the next outlines are the first of this scene
    stage.add(this.level.group);
    this.settled = Promise.resolve(); // resolves when no scene is being opened
    this.choose = attempt((value) => this.#while(this.#choose(value)).then(chosen));
    this.take = attempt((file) => this.#while(this.#take(file))); // a level
    byId("scene").onchange = ({ target }) => this.choose(target.value);
    byId("walkable").onchange = ({ target }) => this.level.showWalkable(target.checked);
    setInterval(() => document.hidden || this.book.poll(), POLL_SECONDS * 1000);
  }

  /** Whether the scene is one of the server's examples. */
  get isExample() {
    return this.choices.some(({ value, example }) => example && value === this.value);
  }

  /** At the start, after `list`: begins in the scene of this name or id, or in none. */
  async begin(wanted) {
    if (this.begun) await this.list();
    let known = this.choices.some(({ value }) => value === wanted);
    if (!known && wanted && wanted === this.file?.id) { // the server has forgotten it
      wanted = await this.#make(this.file);
      known = true;
    }
    if (wanted && !known) tell(`There is no scene ${wanted}; choose one from the list.`);
    await this.#while(this.#choose(known ? wanted : "", true));
  }

  /** At the start, after `list`: attends an existing session in the scene of this id, perhaps made from an example, or in none. */
  async attend(id, example = "") {
    this.value = this.choices.find(({ scene }) => scene === id)?.value ?? example;
    byId("scene").value = this.value;
    await this.#while(this.#open(id));
  }

  #while(opening) {
    this.settled = opening.catch(() => {}); // the caller gets the error
    return opening;
  }

  /** Lists the choices. */
  async list(chosen = "") {
    const [examples, scenes] = await Promise.all([this.api.exampleScenes(), this.api.scenes()]);
    this.choices = choicesOf(examples, scenes);
    byId("scene").replaceChildren(new Option("no scene", ""), ...this.choices.map(({ value, text, summary }) => {
      const option = new Option(text, value, false, value === chosen);
      option.title = summary ?? "";
      return option;
    }));
  }

  /** `listed`: the list is fresh, so it is not requested again. */
  async #choose(value, listed = false) {
    const previous = this.book.id;
    const choice = this.choices.find((known) => known.value === value);
    byId("scene").value = value;
    try {
      const id = choice ? await this.#present(choice, listed) : "";
      await this.#open(id);
      this.value = value;
    } catch (error) {
      byId("scene").value = this.choices.find(({ scene }) => scene === previous)?.value ?? "";
      throw error;
    }
  }

  /** The id of an existing scene; an example is made if it does not exist yet. */
  async #present(choice, listed) {
    if (choice.example && !(listed && choice.scene)) {
      const there = (await this.api.scenes()).find(({ name }) => name === choice.example);
      choice.scene = (there ?? await this.api.createExampleScene(choice.example)).scene_id;
    }
    return choice.scene;
  }

  async #take(file) {
    const format = meshFormat(file.name);
    if (!format) throw new Error(`${file.name}: a level is a GLB, OBJ or PLY file`);
    const bytes = await file.arrayBuffer();
    const id = await this.#make({ bytes, format, name: file.name.slice(0, 64) });
    await this.#open(id);
    this.value = id;
  }

  /** Makes a scene from a file's bytes; returns its id, which can be chosen now. */
  async #make({ bytes, format, name }) {
    const { scene_id: id } = await this.api.createMeshScene(bytes, format, name);
    this.file = { id, bytes, format, name };
    await this.list(id);
    return id;
  }

  async #open(id) {
    if (id && id === this.book.id) { // only the session was lost: what is drawn stays
      await Promise.all([this.enter(id), this.book.poll()]);
      return;
    }
    this.level.clear();
    this.fresh = true;
    await Promise.all([this.enter(id), this.book.open(id)]);
    if (id && id === this.file?.id && this.file.format === "glb") await this.#draw(this.file);
    if (!id) {
      this.stage.lower(0);
      this.stage.overlook(null);
      byId("scene-facts").textContent = "";
    }
    byId("populate").disabled = !id;
  }

  /** Draws a file over its ground; people walk in a file that this page cannot draw, too. */
  async #draw({ bytes, name }) {
    try {
      await this.level.showModel(bytes);
      this.stage.lower(this.level.under);
    } catch (error) {
      tell(`${name} is there to walk in, but this page cannot draw it and shows its ground alone: ${error.message}`);
    }
  }

  #show(outlines) {
    this.level.show(outlines);
    this.stage.lower(this.level.under);
    if (this.fresh) this.stage.overlook(this.level.extent);
    this.fresh = false;
    this.changed();
    this.api.scene(this.book.id).then(
      ({ area_m2: area, islands, notes = [] }) => {
        byId("scene-facts").replaceChildren(
          `${Math.round(area).toLocaleString("en")} m² to walk on${islands > 1 ? `, ${islands} parts` : ""}`,
          ...notes.map((note) => Object.assign(document.createElement("span"), { className: "note", textContent: note })),
        );
      },
      () => {}, // the next poll reports it
    );
  }
}
