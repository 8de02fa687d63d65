// The selected people (none, one, several), and kept groups. No DOM.

export class Selection {
  /** `changed()` is called when the selection changes or a group is kept. */
  constructor(changed) {
    this.people = [];
    this.groups = []; // lists of people, the first is group 1
    this.changed = changed;
  }

  /** The first selected person, for uses that allow only one. */
  get person() {
    return this.people[0] ?? null;
  }

  choose(people) {
    this.people = [...new Set(people)];
    this.changed();
  }

  /** Selects a person in addition, or deselects it. */
  toggle(person) {
    this.choose(this.people.includes(person) ? this.people.filter((other) => other !== person) : [...this.people, person]);
  }

  /** Keeps the selected people as a group; returns its number. */
  keep() {
    this.groups.push([...this.people]);
    this.changed();
    return this.groups.length;
  }

  /** Selects the group of a number, if it exists. */
  recall(number) {
    const group = this.groups[number - 1];
    if (group?.length) this.choose(group);
  }

  /** Keeps only the people who are still `present`, also in groups. Returns whether the selection has changed. */
  prune(present) {
    const there = (person) => present.has(person);
    this.groups = this.groups.map((group) => group.filter(there));
    const left = this.people.filter(there);
    const changed = left.length < this.people.length;
    this.people = left;
    return changed;
  }
}
