"use strict";
// Values under the pointer, or where the arrow keys lead.
for (const chart of document.querySelectorAll("svg[data-chart]")) {
  const data = JSON.parse(document.getElementById(chart.dataset.chart).textContent);
  const told = document.getElementById(chart.dataset.chart + "-told");
  const cursor = chart.querySelector(".cursor");
  let at = data.x.length - 1;
  const show = () => {
    const x = data.left + (data.right - data.left) * at / Math.max(data.x.length - 1, 1);
    cursor.setAttribute("x1", x); cursor.setAttribute("x2", x); cursor.style.visibility = "visible";
    const values = data.lines.map(([name, y]) => name + " " + (y[at] === null || y[at] === undefined ? "-" : y[at]));
    told.textContent = "Iteration " + data.x[at] + ": " + values.join("; ");
  };
  chart.addEventListener("pointermove", event => {
    const box = chart.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * chart.viewBox.baseVal.width;
    const share = (x - data.left) / (data.right - data.left);
    at = Math.min(Math.max(Math.round(share * (data.x.length - 1)), 0), data.x.length - 1);
    show();
  });
  chart.addEventListener("keydown", event => {
    const step = {ArrowLeft: -1, ArrowRight: 1, Home: -data.x.length, End: data.x.length}[event.key];
    if (step === undefined) return;
    at = Math.min(Math.max(at + step, 0), data.x.length - 1);
    event.preventDefault();
    show();
  });
  chart.addEventListener("focus", show);
}
// The motion, played at its own speed.
for (const player of document.querySelectorAll(".player")) {
  const data = JSON.parse(document.getElementById(player.dataset.motion).textContent);
  const button = player.querySelector("button"), slider = player.querySelector("input");
  const told = player.querySelector(".told"), views = [...player.querySelectorAll("svg")];
  const cells = [...player.querySelectorAll("td[data-clause]")];
  let started = null, from = 0;
  const points = list => list.map(p => p.join(",")).join(" ");
  const show = t => {
    slider.value = t;
    slider.setAttribute("aria-valuetext", data.times[t] + " s");
    views.forEach((view, i) => {
      const path = data.paths[i];
      view.querySelector(".done").setAttribute("points", points(path.slice(0, t + 1)));
      view.querySelector(".point").setAttribute("cx", path[t][0]);
      view.querySelector(".point").setAttribute("cy", path[t][1]);
      if (data.robot.length && i === 0) view.querySelector(".robot").setAttribute("points", points(data.robot[t]));
    });
    cells.forEach((cell, i) => { cell.textContent = data.clauses[i][t] === null ? "" : data.clauses[i][t]; });
    told.textContent = data.times[t] + " s" + (t >= data.decides ? ", after what decides" : "");
  };
  const stop = () => { started = null; button.textContent = "Play"; };
  const frame = now => {
    if (started === null) return;
    const t = from + Math.floor((now - started) / 1000 / data.period);
    show(Math.min(t, data.times.length - 1));
    if (t < data.times.length - 1) requestAnimationFrame(frame); else stop();
  };
  button.addEventListener("click", () => {
    if (started !== null) return stop();
    from = Number(slider.value) >= data.times.length - 1 ? 0 : Number(slider.value);
    started = performance.now();
    button.textContent = "Pause";
    requestAnimationFrame(frame);
  });
  slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
  show(data.times.length - 1);
}
