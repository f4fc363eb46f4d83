"use strict";
for (const button of document.querySelectorAll("button[data-copy]")) {
  button.hidden = false;
  button.addEventListener("click", async () => {
    const source = document.getElementById(button.dataset.copy);
    const chosen = getSelection();
    chosen.selectAllChildren(source);
    let done = false;
    try {
      await navigator.clipboard.writeText(source.textContent);
      done = true;
    } catch {
      done = document.execCommand("copy");
    }
    if (done) chosen.removeAllRanges();
    button.textContent = done ? "Copied" : "Press Ctrl+C";
    document.getElementById("copied").textContent = done ? "Copied." : "Selected: press Ctrl+C.";
    setTimeout(() => { button.textContent = "Copy"; }, 2000);
  });
}
