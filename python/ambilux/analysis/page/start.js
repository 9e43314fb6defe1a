"use strict";
const REPORT = JSON.parse(document.getElementById("data").textContent);

const plots = [...document.querySelectorAll(".plot")].map(element => new Plot(element, REPORT.plot));

// Images are decoded when they come near the screen: pages of many scenes open at once.
const viewers = new Map();
const near = new IntersectionObserver(entries => {
  for (const {target, isIntersecting} of entries) {
    if (!isIntersecting || viewers.has(target)) continue;
    const viewer = new Viewer(target, REPORT.scenes[target.dataset.scene], REPORT.colours);
    viewers.set(target, viewer);
    viewer.start().catch(error => { target.textContent = `This browser cannot show the images (${error.message}); it needs DecompressionStream, which all current browsers have.`; });
  }
}, {rootMargin: "800px"});
for (const element of document.querySelectorAll(".viewer")) near.observe(element);
let waiting = 0;
window.addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(() => { viewers.forEach(v => v.canvases && v.layout()); plots.forEach(p => p.draw()); }, 150); });
