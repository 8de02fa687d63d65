// The selected people (none, one, several), and kept groups. No DOM.

export class Selection {
  /** `changed()` is called when others are selected or a group is kept. */
  constructor(changed) {
    this.people = [];
    this.groups = []; // lists of people, the first is group 1
    this.changed = changed;
  }

  /** The first selected person, where there can be only one. */
  get person() {
    return this.people[0] ?? null;
  }

  choose(people) {
    this.people = [...new Set(people)];
    this.changed();
  }

  /** Select somebody as well, or no longer. */
  toggle(person) {
    this.choose(this.people.includes(person) ? this.people.filter((other) => other !== person) : [...this.people, person]);
  }

  /** Keeps the selected people as a group; returns its number. */
  keep() {
    this.groups.push([...this.people]);
    this.changed();
    return this.groups.length;
  }

  /** Select the group of a number, if there is one. */
  recall(number) {
    const group = this.groups[number - 1];
    if (group?.length) this.choose(group);
  }

  /** Only these are there still: the others are selected no longer, and in no group. Whether the selection has changed. */
  prune(present) {
    const there = (person) => present.has(person);
    this.groups = this.groups.map((group) => group.filter(there));
    const left = this.people.filter(there);
    const changed = left.length < this.people.length;
    this.people = left;
    return changed;
  }
}
