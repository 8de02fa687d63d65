// Files of the user's: dropped on the page, or chosen.

import { isCharacter } from "./character.js";

/** Let a file be dropped anywhere on the page, and be chosen with `inputs`: `take(file)` gets it. */
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
    if (event.dataTransfer.files[0]) take(event.dataTransfer.files[0]);
  });
  for (const input of inputs) {
    input.onchange = () => {
      const [file] = input.files;
      input.value = ""; // the same one may be chosen again
      if (file) take(file);
    };
  }
}

/** What a file is: "character", or "level", of which the scene panel says whether it can be read. */
export async function kindOf(file) {
  const ending = file.name.toLowerCase().split(".").at(-1);
  if (ending === "vrm") return "character";
  if (ending === "fbx") throw new Error(`${file.name}: FBX cannot be read here; save it as GLB (in Blender: File, Export, glTF 2.0)`);
  return ending === "glb" && isCharacter(await file.arrayBuffer()) ? "character" : "level";
}
