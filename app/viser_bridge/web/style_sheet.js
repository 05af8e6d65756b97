// The style sheet of our HTML, in the head of the document.
export function setStyleSheet({ css }) {
  const found = document.getElementById("eigenfairing-style");
  const sheet = found ?? document.head.appendChild(document.createElement("style"));
  sheet.id = "eigenfairing-style";
  sheet.textContent = css;
}
