// The user's files: dropped on the page, or chosen.

import { isCharacter } from "./character.js";
import { isLevel, readGlb } from "./glb.js";

/**
 * Accepts files that are dropped on the page, or chosen with `inputs`: pairs of an element and the purpose of its files.
 * `take(file, purpose)` receives them; the purpose of a dropped file is "".
 */
export function watchFiles(inputs, take) {
  const holdsFile = (event) => event.dataTransfer?.types.includes("Files");
  addEventListener("dragover", (event) => {
    if (!holdsFile(event)) return;
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  addEventListener("dragleave", (event) => event.relatedTarget ?? document.body.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    if (!holdsFile(event)) return;
    event.preventDefault();
    document.body.classList.remove("dropping");
    if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0], "");
  });
  for (const [input, purpose] of inputs) {
    input.onchange = () => {
      const [file] = input.files;
      input.value = ""; // the same one may be chosen again
      if (file) take(file, purpose);
    };
  }
}

/**
 * The kind of a file: "character", or "level", which the scene panel checks further. The purpose for which it was chosen decides; a
 * dropped file is a character if it has a skin and does not mostly consist of other things.
 */
export async function kindOf(file, purpose) {
  const ending = file.name.toLowerCase().split(".").at(-1);
  if (ending === "fbx") throw new Error(`${file.name}: FBX cannot be read here; save it as GLB (in Blender: File, Export, glTF 2.0)`);
  if (purpose) return purpose;
  if (ending === "vrm") return "character";
  if (ending !== "glb") return "level";
  const bytes = await file.arrayBuffer();
  return isCharacter(bytes) && !isLevel(readGlb(bytes)) ? "character" : "level";
}
