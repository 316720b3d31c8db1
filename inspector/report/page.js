document.documentElement.classList.add("live");

for (const compare of document.querySelectorAll(".compare")) {
  const slider = compare.querySelector("input[type=range]");
  const place = () => compare.style.setProperty("--at", `${slider.value}%`);
  slider.addEventListener("input", place);
  place();
  for (const choice of compare.parentElement.querySelectorAll("input[type=radio]")) {
    choice.addEventListener("change", () => {
      compare.querySelector(".left img").src = choice.value;
      compare.querySelector(".left .tag").textContent = choice.dataset.name;
    });
  }
}

const button = document.getElementById("open");
const hint = document.getElementById("how-to-serve");
const viewer = document.getElementById("viewer");

async function viewerIsServed() {
  if (location.protocol === "file:") return false;
  try {
    return (await fetch("viewer/re_viewer.js", { method: "HEAD" })).ok;
  } catch {
    return false;
  }
}

button.addEventListener("click", async () => {
  if (!(await viewerIsServed())) {
    hint.hidden = false;
    return;
  }
  const recording = new URL(button.dataset.recording, location.href).href;
  const address = `viewer/index.html?hide_welcome_screen=1&persist=0&renderer=webgl&url=${encodeURIComponent(recording)}`;
  viewer.querySelector("iframe").src = address;
  viewer.querySelector("a").href = address;
  viewer.hidden = false;
  button.hidden = true;
});
