// What the file of a page gives to its script.
export const pageData = () => JSON.parse(document.getElementById("data").textContent);
