// Shows the OpenAPI document of the server that this page comes from.
SwaggerUIBundle({
  url: "../openapi.json",
  dom_id: "#reference",
  deepLinking: true,
  validatorUrl: null, // else the document's address is sent to a server elsewhere
});
