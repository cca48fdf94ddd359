// The words after # in the page's address, for a screen without a keyboard: #show,transparent or #dark&follow=12.

/**
 * Words without a value; words whose value may be missing; the pattern of each value: as many numbers as the word
 * takes, or a language.
 */
const ALONE = ["show", "moon", "hands", "desk", "tell", "transparent", "nolabels", "keys", "dark", "light", "sound"];
const OPTIONAL = ["follow", "seat"];
const WITH = { follow: /^[1-9]\d*$/, bench: /^[1-9]\d*$/, rotate: /^-?\d+(\.\d+)?$/,
    view: /^-?[\d.]+,-?[\d.]+,[\d.]+$/, lang: /^(en|zh)$/, at: /^\d+(\.\d+)?$/, seat: /^-?[\d.]+(,[\d.]+){0,2}$/ };

/** The decoded text of an address; the text itself if it cannot be decoded. */
function textOf(address) {
  try {
    return decodeURI(address);
  } catch {
    return address;
  }
}

const partsOf = (hash) => textOf(hash).replace(/^#/, "").split(/&|,(?![-\d.])/).filter(Boolean);

/** Returns the address with a word of a number, or without that word if the number is null. */
export function withWord(hash, word, number) {
  const others = partsOf(hash).filter((part) => part.split("=")[0] !== word);
  const all = number === null ? others : [...others, `${word}=${number}`];
  return all.length ? `#${all.join("&")}` : "";
}

/**
 * Parses the address: each word with its value, and `unknown`, all unknown words. A value is a list of numbers, even of
 * one number, or a language; it is `true` for a word without a value. Commas or & separate words; numbers after a comma
 * belong to the word before.
 */
export function wordsOf(hash) {
  const said = { unknown: [] };
  for (const part of partsOf(hash)) {
    const [word, value] = part.split("=");
    if (value === undefined && (ALONE.includes(word) || OPTIONAL.includes(word))) said[word] = true;
    else if (value !== undefined && Object.hasOwn(WITH, word) && WITH[word].test(value)) said[word] = word === "lang"
        ? value : value.split(",").map(Number);
    else said.unknown.push(part);
  }
  return said;
}
