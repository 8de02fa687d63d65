// Shows the OpenAPI document of the server that this page comes from, below any proxy's path.
const { href } = new URL("..", location.href);
fetch(`${href}openapi.json`).then((answer) => answer.json()).then((spec) => SwaggerUIBundle({
  spec: { ...spec, servers: [{ url: href.replace(/\/$/, "") }] },
  dom_id: "#reference",
  deepLinking: true,
  validatorUrl: null, // otherwise the document's address is sent to a server on the internet
}));
