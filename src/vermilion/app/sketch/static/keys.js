// Every key, what it does, and the sheet that lists them.
const held = (event) => (event.ctrlKey || event.metaKey ? "Ctrl+" : "") + (event.altKey ? "Alt+" : "") + (event.shiftKey ? "Shift+" : "");

export class Keys {
  constructor() { this.actions = new Map(); this.sections = []; }
  // `rows`: [key or list of keys, what it does, action]; a key is "A", "Shift+N", "Ctrl+Z".
  add(title, rows) {
    this.sections.push({ title, rows });
    for (const [keys, , action] of rows) for (const key of [keys].flat()) this.actions.set(key.toLowerCase(), action);
  }
  handle(event) {
    const target = event.target;
    if (document.querySelector("dialog[open]")) return;
    if (["SELECT", "INPUT"].includes(target.tagName) && event.key !== "Escape") return;
    if (target.tagName === "BUTTON" && [" ", "Enter"].includes(event.key)) return;
    const key = event.key === " " ? "space" : event.key.toLowerCase();
    // A sign such as ? needs Shift on some keyboards and not on others.
    const sign = key.length === 1 && !/[a-z0-9]/.test(key);
    const action = this.actions.get((sign ? held(event).replace("Shift+", "") : held(event)).toLowerCase() + key);
    if (!action) return;
    event.preventDefault();
    action(event);
  }
  sheet() {
    return this.sections.map(({ title, rows }) => {
      const section = document.createElement("section");
      section.appendChild(document.createElement("h3")).textContent = title;
      for (const [keys, what] of rows) {
        const row = section.appendChild(document.createElement("div"));
        row.appendChild(document.createElement("span")).textContent = what;
        const names = row.appendChild(document.createElement("span"));
        for (const key of [keys].flat()) {
          names.appendChild(document.createElement("kbd")).textContent = key
            .replace("ArrowLeft", "←").replace("ArrowRight", "→").replace("ArrowUp", "↑").replace("ArrowDown", "↓");
          names.append(" ");
        }
      }
      return section;
    });
  }
}
