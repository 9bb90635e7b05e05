// The API's description, drawn from the service's own openapi.json by the packaged swagger-ui.
const place = document.getElementById("swagger");
window.SwaggerUIBundle({ url: place.dataset.openapi, domNode: place, validatorUrl: null });
