// <wayfarer-view scene="corridor" session="…">: the viewer in another page. The page's origin must be in the server's setting
// cors_origins, unless the page is of the visitor's own machine, or the server's own, and the server asks for no credentials.

const PASSED = ["scene", "session", "look", "people"]; // attributes that the viewer's address has, too

export class WayfarerView extends HTMLElement {
  static observedAttributes = ["server", "replay", ...PASSED];

  connectedCallback() {
    if (!this.shadowRoot) {
      const frame = document.createElement("iframe");
      frame.allow = "fullscreen; gamepad; clipboard-write";
      Object.assign(frame.style, { border: "0", width: "100%", height: "100%", display: "block" });
      this.attachShadow({ mode: "open" }).append(frame);
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

  #show() {
    const url = new URL(this.server.replace(/\/?$/, "/"), location.href);
    url.searchParams.set("embed", "");
    for (const name of PASSED) if (this.hasAttribute(name)) url.searchParams.set(name, this.getAttribute(name));
    if (this.hasAttribute("replay")) url.hash = `replay=${this.getAttribute("replay")}`;
    const frame = this.shadowRoot.firstChild;
    frame.title = this.getAttribute("title") ?? "People who walk, by Wayfarer";
    if (frame.src !== url.href) frame.src = url.href;
  }
}

customElements.define("wayfarer-view", WayfarerView);
