// Show the rows, experiments and chapters that match the words, the group and the verdict.
const words = document.getElementById("words");
const group = document.getElementById("group");
const verdict = document.getElementById("verdict");
const shown = document.getElementById("shown");
const chapters = [...document.querySelectorAll(".chapter")].map((chapter) => ({
  chapter,
  sections: [...chapter.querySelectorAll("section")].map((section) => ({
    section,
    title: section.querySelector("h3").textContent.toLowerCase(),
    rows: [...section.querySelectorAll("tr[data-verdict]")].map((row) => ({
      row, text: row.textContent.toLowerCase(), verdict: row.dataset.verdict })),
  })),
}));

function apply() {
  const wanted = words.value.trim().toLowerCase();
  const filtered = wanted !== "" || verdict.value !== "";
  let count = 0;
  for (const { chapter, sections } of chapters) {
    let any = !filtered;
    for (const { section, title, rows } of sections) {
      let visible = 0;
      for (const entry of rows) {
        const match = (verdict.value === "" || entry.verdict === verdict.value)
          && (title.includes(wanted) || entry.text.includes(wanted));
        entry.row.hidden = !match;
        visible += match;
      }
      section.hidden = filtered && visible === 0 && !(verdict.value === "" && title.includes(wanted));
      any = any || !section.hidden;
      if (group.value === "" || group.value === chapter.dataset.group) count += visible;
    }
    chapter.hidden = !any || (group.value !== "" && group.value !== chapter.dataset.group);
  }
  shown.textContent = filtered || group.value !== "" ? `${count} numbers` : "";
}

for (const control of [words, group, verdict]) control.addEventListener("input", apply);
