// Elements of the page: finding, making, switching; and what is said when nothing can be shown.

const byId = (id) => document.getElementById(id);

function element(tag, text) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  return made;
}

function option(value, text) {
  const made = element("option", text);
  made.value = value;
  return made;
}

function toggle(button) {
  const on = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", on);
  return on;
}

function fail(text) {
  byId("failure").textContent = text;
  byId("failure").hidden = false;
  document.documentElement.dataset.state = "failed";
}
