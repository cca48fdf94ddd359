// The words after # in the page's address, for a screen without a keyboard: #show,transparent or #dark&follow=12.

/** Words that stand alone, and words that take numbers (as many as named) or a word after `=`. */
const ALONE = ["show", "transparent", "nolabels", "dark", "light", "sound"];
const WITH = { follow: /^[1-9]\d*$/, bench: /^[1-9]\d*$/, rotate: /^-?\d+(\.\d+)?$/, view: /^-?[\d.]+,-?[\d.]+,[\d.]+$/, lang: /^(en|zh)$/ };

/** The text of an address; one that is no encoding of a text stands as it is. */
function textOf(address) {
  try {
    return decodeURI(address);
  } catch {
    return address;
  }
}

/**
 * What the address says: each word with its value, `true` where it has none, numbers as numbers, a place as three of
 * them; and `unknown`, all that is not understood. Commas or & part the words; numbers after a comma belong to the word before.
 */
export function wordsOf(hash) {
  const said = { unknown: [] };
  for (const part of textOf(hash).replace(/^#/, "").split(/&|,(?![-\d.])/).filter(Boolean)) {
    const [word, value] = part.split("=");
    if (value === undefined && (ALONE.includes(word) || word === "follow")) said[word] = true;
    else if (value !== undefined && Object.hasOwn(WITH, word) && WITH[word].test(value)) said[word] = word === "lang" ? value : value.split(",").map(Number);
    else said.unknown.push(part);
  }
  return said;
}
