// <wayfarer-view scene="corridor" session="…">: the viewer in another page. The page's origin must be in the server's setting
// cors_origins, unless the page is of the visitor's own machine, or the server's own, and the server asks for no credentials.

const PATIENCE = 1000; // ms after the frame has loaded within which its page should report
const PASSED = ["scene", "session", "look", "people"]; // attributes that the viewer's address has, too

export class WayfarerView extends HTMLElement {
  static observedAttributes = ["server", "replay", ...PASSED];

  reported = false; // the page in the frame is the viewer

  connectedCallback() {
    if (!this.shadowRoot) {
      const frame = document.createElement("iframe");
      frame.allow = "fullscreen; gamepad; clipboard-write";
      Object.assign(frame.style, { border: "0", width: "100%", height: "100%", display: "block" });
      frame.onload = () => this.#check(frame.src);
      addEventListener("message", ({ source, data }) => {
        if (source === frame.contentWindow && data === "wayfarer") this.#tell("");
      });
      const said = document.createElement("p"); // why the frame is empty
      said.setAttribute("role", "status");
      Object.assign(said.style, { margin: "0", padding: "1em", font: "14px/1.5 system-ui, sans-serif" });
      this.attachShadow({ mode: "open" }).append(frame, said);
      if (getComputedStyle(this).display === "inline") this.style.display = "block";
      if (!this.style.height && this.clientHeight === 0) this.style.height = "480px";
    }
    this.#show();
  }

  attributeChangedCallback() {
    if (this.shadowRoot) this.#show();
  }

  /** The server's address; without the attribute, where this file came from. */
  get server() {
    return this.getAttribute("server") ?? new URL(".", import.meta.url).href;
  }

  /** Shows why the frame is empty if the page in it has not reported, since a page of another origin cannot be inspected. */
  async #check(address) {
    await new Promise((go) => setTimeout(go, PATIENCE));
    const [frame] = this.shadowRoot.children;
    const answers = await fetch(address, { mode: "no-cors" }).then(() => true, () => false);
    if (this.reported || frame.src !== address) return;
    const { origin } = new URL(address);
    this.#tell(answers ? `${origin} lets no page of ${location.origin} show it: add "${location.origin}" to its setting cors_origins.` : `${origin} does not answer.`);
  }

  /** Shows this text instead of the frame; "": the frame. */
  #tell(text) {
    const [frame, said] = this.shadowRoot.children;
    this.reported = !text;
    said.textContent = text;
    frame.style.display = text ? "none" : "block";
  }

  #show() {
    const url = new URL(this.server.replace(/\/?$/, "/"), location.href);
    url.searchParams.set("embed", "");
    for (const name of PASSED) if (this.hasAttribute(name)) url.searchParams.set(name, this.getAttribute(name));
    if (this.hasAttribute("replay")) url.hash = `replay=${this.getAttribute("replay")}`;
    const [frame] = this.shadowRoot.children;
    frame.title = this.getAttribute("title") ?? "People who walk, by Wayfarer";
    if (frame.src === url.href) return;
    this.reported = false;
    frame.src = url.href;
  }
}

customElements.define("wayfarer-view", WayfarerView);
