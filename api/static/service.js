// Requests to the service, with its errors as words.

export async function ask(path, options = {}) {
  const answer = await fetch(path, options);
  if (answer.ok) return answer;
  let words = `${answer.status} ${answer.statusText}`;
  try {
    words = (await answer.json()).error.text;
  } catch {
    // not an answer of the service itself
  }
  throw new Error(words);
}

export async function askJson(path, options = {}) {
  return (await ask(path, { headers: { Accept: "application/json" }, ...options })).json();
}
