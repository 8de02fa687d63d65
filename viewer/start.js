// Begins the page, or shows the reason why it cannot.

if (parent !== globalThis) parent.postMessage("wayfarer", "*"); // it is shown: wayfarer-view.js waits for it

import("./main.js").catch((error) => {
  document.querySelector("#trouble-title").textContent = "The page could not be loaded";
  document.querySelector("#trouble-text").textContent = `${error.message}. Is the server running? Reload the page to try again.`;
  document.querySelector("#trouble").hidden = false;
});
