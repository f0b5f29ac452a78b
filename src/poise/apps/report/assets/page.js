// One clock for the whole page: the replay and a cursor in every plot over time follow it.
(() => {
  "use strict";
  const listeners = [];
  const clock = {
    time: null,
    onChange(listener) {
      listeners.push(listener);
    },
    set(time) {
      clock.time = time;
      for (const listener of listeners) listener(time);
    },
  };
  window.poiseClock = clock;

  for (const plot of document.querySelectorAll(".plot[data-axes]")) {
    const cursors = JSON.parse(plot.dataset.axes).map((box) => {
      const [x0, x1, top, bottom, start, end] = box;
      const line = document.createElement("div");
      line.className = "cursor";
      line.style.top = `${100 * top}%`;
      line.style.height = `${100 * (bottom - top)}%`;
      plot.append(line);
      return { line, x0, x1, start, end };
    });
    clock.onChange((time) => {
      for (const { line, x0, x1, start, end } of cursors) {
        const share = (time - start) / (end - start);
        line.style.display = share >= 0 && share <= 1 ? "block" : "none";
        line.style.left = `${100 * (x0 + share * (x1 - x0))}%`;
      }
    });
    plot.addEventListener("click", (event) => {
      const frame = plot.getBoundingClientRect();
      const { x0, x1, start, end } = cursors[0];
      const share = ((event.clientX - frame.left) / frame.width - x0) / (x1 - x0);
      if (share >= 0 && share <= 1) clock.set(start + share * (end - start));
    });
  }

  // A moment that a table names: there the clock goes, and the replay comes into view.
  for (const button of document.querySelectorAll("[data-time]")) {
    button.addEventListener("click", () => {
      clock.set(Number(button.dataset.time));
      document.getElementById("replay")?.scrollIntoView({ behavior: "smooth" });
    });
  }
})();
