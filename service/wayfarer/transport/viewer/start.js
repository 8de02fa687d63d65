// Begins the page, or says why it cannot.

const drawn = document.createElement("canvas").getContext("webgl2");
if (drawn) {
  drawn.getExtension("WEBGL_lose_context")?.loseContext();
  import("./main.js").catch((error) => trouble("The page could not be loaded", `${error.message}. Is the server running? Reload the page to try again.`));
} else {
  document.querySelector("#connection").textContent = "not connected";
  document.querySelector("#connection").dataset.state = "lost";
  trouble(
    "This browser shows no 3D",
    "WebGL 2 is off or missing. Switch on hardware acceleration in the browser's settings, or open the page in another browser.",
  );
}

function trouble(title, text) {
  document.querySelector("#trouble-title").textContent = title;
  document.querySelector("#trouble-text").textContent = text;
  document.querySelector("#trouble").hidden = false;
}
