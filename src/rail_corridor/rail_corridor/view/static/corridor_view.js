// The page: asks for a message a few times a second, and shows it.
// Vue and Quasar come with NiceGUI; nothing is fetched from anywhere else.

import { drawError, drawTimeDistance } from '/assets/chart.js';
import { drawStrip, extent, offsets, placeOf } from '/assets/line.js';
import { drawMap } from '/assets/map.js';
import { drawPlane, drawSpectrum, drawTime } from '/assets/scope.js';
import { clock, engineering, groupColours } from '/assets/theme.js';
import { template } from '/assets/template.js';

const ASK_MS = 210;
const PATIENCE_MS = 4000;
const STATUS = {
  connecting: 'reaching the viewer',
  lost: 'the viewer does not answer',
  waiting: 'waiting for a corridor',
  starting: 'corridor starting: nodes are connecting',
  running: 'running',
  still: 'standing still',
  ended: 'run ended',
  gone: 'the corridor has gone',
};
// Between the first two and the last two stand the panels of the equipment.
const TABS = [{ name: 'distance', label: 'Time–distance' }, { name: 'scope', label: 'Scope' }];
const LAST_TABS = [{ name: 'health', label: 'Health' }, { name: 'faults', label: 'Faults' }];
const MEASURED = -1; // of the estimates whose error can be drawn: the measured position

export default {
  template,
  data() {
    return {
      tab: 'distance', status: 'connecting', frame: {}, line: {}, lists: { waveforms: [], equipment: [] },
      health: { status: [], failed: [], events: [] }, telegrams: [], scope: null, scopeTopic: null, antenna: 0, zoom: 16,
      waveformFilter: '', train: '', span: 0, asMap: false, last: 0, help: false, dark: false,
      errorOf: MEASURED, wish: '', busy: {}, onlyPicked: false, domain: null, since: 0,
    };
  },
  computed: {
    trains() { return this.frame.trains || []; },
    picked() { return this.trains.find((train) => train.name === this.train) || null; },
    panels() { return this.line.panels || []; },
    tabs() { return [...TABS, ...this.panels, ...LAST_TABS]; },
    panel() { return this.panels.find((panel) => panel.name === this.tab) || null; },
    panelCards() {
      const topics = new Set((this.frame.panel || {}).cards || []);
      return (this.frame.cards || []).filter((card) => topics.has(card.topic));
    },
    groups() { return groupColours(this.line); },
    rowLegend() {
      return (this.line.rows || []).filter((row) => !row.on_track)
        .map((row) => ({ name: row.name, sign: row.stretches.length ? 'filled' : row.symbol, text: row.legend }));
    },
    intervalLegend() {
      return [...new Set(this.trains.flatMap((train) => train.intervals || []).map((each) => each.label))];
    },
    columns() {
      return (this.line.columns || []).filter((column) => column.always || this.trains.some((train) => train.cells[column.key]));
    },
    traces() {
      const measured = this.line.position_label || 'measured';
      const there = (k) => this.trains.some((_, train) => this.hasTrace(train, k));
      return [
        { label: measured, value: MEASURED, caption: `Error of ${measured}, measured minus true; shaded: the ± 2σ it claims` },
        ...(this.line.traces || []).map((trace, k) => ({ ...trace, value: k })).filter((trace) => there(trace.value)),
      ];
    },
    traced() { return this.traces.find((trace) => trace.value === this.errorOf) || this.traces[0]; },
    statusText() {
      const rate = this.frame.rate;
      if (this.status === 'running') return rate == null ? 'running' : `running at ${rate < 10 ? rate.toFixed(1) : Math.round(rate)} × real time`;
      if (this.status === 'still') return `standing still: no tick for ${Math.round(this.frame.silent_s)} s`;
      if (this.status === 'ended') return `run ended at ${clock(this.frame.t)}`;
      if (this.status === 'gone') return `the corridor has gone; last tick at ${clock(this.frame.t)}`;
      return STATUS[this.status];
    },
    banner() {
      if (this.status === 'lost') return 'The viewer does not answer. Is “rail view” still running? The page tries again by itself.';
      if (this.status === 'starting') return 'A corridor is starting: its nodes are connecting to each other.';
      if (this.status === 'still') return 'No tick comes: the corridor waits for a node that does not answer, or was paused.';
      if (this.status === 'gone') return 'The corridor was ended before its time. What is shown is its last state; a new run is followed by itself.';
      if (this.status === 'ended') return 'The run has come to its end. What is shown is its last state; a new run is followed by itself.';
      return '';
    },
    hasAuthority() { return this.trains.some((train) => train.end_m != null); },
    supervised() { return this.trains.some((train) => train.permitted_kmh !== undefined); },
    waveforms() {
      const wish = this.waveformFilter.toLowerCase();
      return this.lists.waveforms.filter((name) => name.toLowerCase().includes(wish));
    },
    equipment() {
      const wish = this.wish.toLowerCase();
      const off = new Set(this.frame.off || []);
      const failed = new Set(this.frame.failed || []);
      return this.lists.equipment
        .filter((name) => name.toLowerCase().includes(wish))
        .map((name) => ({ name, on: !off.has(name), failed: failed.has(name) }));
    },
    faults() {
      return (this.line.faults || []).map((fault) => {
        const now = this.frame.t >= fault.from_s && this.frame.t < fault.to_s;
        const over = this.frame.t >= fault.to_s;
        return { kind: fault.kind.replace(/_/g, ' '), what: fault.subject, fault, state: now ? 'now' : over ? 'over' : 'to come' };
      });
    },
    shownTelegrams() {
      const about = (line) => line.from === this.train || line.to === this.train;
      return (this.onlyPicked ? this.telegrams.filter(about) : this.telegrams).slice(0, 120);
    },
    kindOfPlane() {
      const plane = this.scope && this.scope.plane;
      if (!plane || plane.kind === 'samples') return 'Samples in the I/Q plane';
      const noise = plane.snr_db == null ? '' : plane.snr_db > 60 ? ', free of noise' : `, SNR ${plane.snr_db} dB`;
      const how = plane.kind === 'symbols' ? 'after combining' : 'behind the matched filter';
      return `Constellation: ${plane.constellation.toUpperCase()}, slot ${plane.slot}, ${how}${noise}`;
    },
  },
  watch: {
    tab() { this.telegrams = []; this.writeHash(); this.soon(); },
    tabs() { if (!this.tabs.some((tab) => tab.name === this.tab)) this.tab = 'distance'; },
    asMap() { this.draw(); },
    span() { this.draw(); },
    errorOf() { this.draw(); },
    last() { this.draw(); },
    train() { this.writeHash(); this.soon(); },
    scopeTopic() { this.scope = null; this.writeHash(); this.soon(); },
  },
  created() {
    // Large, and drawn rather than bound: kept out of Vue's sight.
    this.rows = [];
    this.generation = -1;
    this.have = { run: -1, health: -1, lists: -1 };
    this.hits = [];
    this.browser = Math.random().toString(36).slice(2);
  },
  mounted() {
    const kept = localStorage.getItem('corridor.dark');
    if (kept !== null) this.$q.dark.set(kept === 'true');
    this.dark = this.$q.dark.isActive;
    this.readHash();
    window.addEventListener('hashchange', () => this.readHash());
    this.resize = new ResizeObserver(() => this.draw());
    this.resize.observe(this.$el);
    this.ask();
  },
  unmounted() {
    clearTimeout(this.timer);
    this.resize.disconnect();
    this.ended = true;
  },
  methods: {
    clock, engineering,
    async ask() {
      clearTimeout(this.timer);
      const stop = new AbortController();
      const patience = setTimeout(() => stop.abort(), PATIENCE_MS);
      const asked = (this.asked = (this.asked || 0) + 1);
      try {
        const answer = await fetch(`/live?${this.query()}`, { signal: stop.signal });
        if (!answer.ok) throw new Error(String(answer.status));
        const message = await answer.json();
        if (asked === this.asked && !this.ended) this.take(message);
      } catch (error) {
        if (asked === this.asked) { this.status = 'lost'; }
      }
      clearTimeout(patience);
      if (asked !== this.asked || this.ended) return;
      // A page that nobody sees asks for little.
      this.timer = setTimeout(() => this.ask(), document.hidden ? 10 * ASK_MS : this.status === 'lost' ? 1000 : ASK_MS);
    },
    // What is looked at stands in the address, to be kept or passed on.
    readHash() {
      const values = new URLSearchParams(window.location.hash.slice(1));
      // Which panels there are is known with the first message.
      if (values.get('tab') && (!this.line.panels || this.tabs.some((tab) => tab.name === values.get('tab')))) this.tab = values.get('tab');
      if (values.get('train')) this.train = values.get('train');
      if (values.get('topic')) this.scopeTopic = values.get('topic');
    },
    writeHash() {
      const values = { tab: this.tab, train: this.train };
      if (this.tab === 'scope' && this.scopeTopic) values.topic = this.scopeTopic;
      window.history.replaceState(null, '', `#${new URLSearchParams(values)}`);
    },
    soon() {
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.ask(), 0);
    },
    query() {
      const newest = this.telegrams.length ? this.telegrams[0].id : 0;
      const values = {
        browser: this.browser, train: this.train, tab: this.tab, run: this.have.run, health: this.have.health,
        lists: this.have.lists, generation: this.generation, rows: this.rows.length, telegrams: newest,
      };
      if (this.tab === 'scope' && this.scopeTopic) Object.assign(values, { scope: this.scopeTopic, antenna: this.antenna, zoom: this.zoom });
      return new URLSearchParams(values).toString();
    },
    take(message) {
      this.status = message.status;
      this.domain = message.domain;
      if (message.line) {
        this.line = Object.freeze(message.line);
        this.have.run = message.run;
        this.telegrams = [];
      }
      const { generation, begin, rows } = message.history;
      this.rows = begin === 0 ? rows : this.rows.slice(0, begin).concat(rows);
      this.generation = generation;
      if (message.lists) { this.lists = Object.freeze(message.lists); this.have.lists = message.lists.version; }
      if (message.health) { this.health = Object.freeze(message.health); this.have.health = message.health.version; }
      if (this.panel && this.panel.log && message.telegrams && message.telegrams.length) this.telegrams = [...message.telegrams.reverse(), ...this.telegrams].slice(0, 400);
      this.scope = message.scope ? Object.freeze(message.scope) : null;
      this.frame = Object.freeze(message);
      const names = message.trains.map((train) => train.name);
      if (names.length && !names.includes(this.train)) this.train = names[0] || '';
      if (this.tab === 'scope' && !this.scopeTopic && this.lists.waveforms.length) this.scopeTopic = this.likely();
      this.dark = this.$q.dark.isActive;
      this.$nextTick(() => this.draw());
    },
    likely() {
      const mine = (name) => name.startsWith(`/${this.train}/`) && name.endsWith('/tx');
      return this.lists.waveforms.find(mine) || this.lists.waveforms[0];
    },
    draw() {
      const { line: strip, distance, error, time, spectrum, plane } = this.$refs;
      const options = { dark: this.dark, train: this.train };
      if (strip && strip.clientWidth) {
        const view = this.span ? { span_m: this.span, centre_m: this.centre() } : {};
        this.hits = (this.asMap ? drawMap : drawStrip)(strip, this.line, this.frame, { ...options, ...view });
      }
      const names = this.trains.map((train) => train.name);
      if (distance && distance.clientWidth) {
        drawTimeDistance(distance, this.line, this.rows, names, { ...options, last_s: this.last, height: Math.max(280, Math.min(460, 0.44 * window.innerHeight)) });
      }
      const index = names.indexOf(this.train);
      if (error && error.clientWidth && index >= 0) drawError(error, this.rows, index, { ...options, trace: this.traced.value });
      const shown = this.scope;
      if (shown && shown.time && time && time.clientWidth) {
        drawTime(time, shown, this.dark);
        drawSpectrum(spectrum, shown, this.dark);
        drawPlane(plane, shown, this.dark);
      }
    },
    centre() {
      const place = this.picked && placeOf(this.picked);
      if (!place) return this.lastCentre || extent(this.line) / 2;
      this.lastCentre = (offsets(this.line).get(place.track) || 0) + place.at;
      return this.lastCentre;
    },
    click(event) {
      const box = event.target.getBoundingClientRect();
      const [x, y] = [event.clientX - box.left, event.clientY - box.top];
      let best = null;
      for (const hit of this.hits) {
        const away = Math.hypot(hit.x - x, (hit.y - y) / 2);
        if (away < 24 && (!best || away < best.away)) best = { away, name: hit.name };
      }
      if (best) this.train = best.name;
    },
    toggleDark() {
      this.$q.dark.toggle();
      this.dark = this.$q.dark.isActive;
      localStorage.setItem('corridor.dark', String(this.dark));
      this.draw();
    },
    where(train) {
      if (!train.on) return 'not on the line';
      if (train.gone) return `nobody says (last ${this.km(train.at_m)})`;
      if (train.at_m == null) return 'no word yet';
      return train.known ? this.km(train.at_m) : `not known (last ${this.km(train.at_m)})`;
    },
    km(metres) { return `${(metres / 1000).toFixed(3)} km`; },
    signed(value, digits) {
      if (value == null) return '–';
      const text = Math.abs(value).toFixed(digits);
      return `${Number(text) === 0 ? '' : value > 0 ? '+' : '−'}${text}`;
    },
    cell(train, column) {
      const [text = '–', tone = '', note = '', group = null] = (train.on && train.cells[column.key]) || [];
      return { text, tone, note, group };
    },
    // Whether a cell is the last of a row that is too short.
    filling(row, k) { return k === row.length - 1 && row.length < this.frame.panel.headings.length; },
    // Whether there is anything of a trace of a train.
    hasTrace(train, trace) { return this.rows.some((row) => row[train + 1] && row[train + 1].length > 4 + 3 * trace); },
    braking(train) {
      if (train.brake === 'emergency_brake') return 'emergency brake';
      if (train.brake === 'service_brake') return 'service brake';
      return train.brake === 'warning' ? 'warning' : '';
    },
    colourOf(group) {
      const found = this.groups.get(group);
      return found ? { background: found.colour, color: found.text } : {};
    },
    gauge(card) {
      // Two and a half half-widths to either side; what lies beyond stands at the edge.
      const { off_m: off, half_m: half, low_m: low = -half, high_m: high = half } = card.gauge;
      const reach = 2.5 * Math.max(half, 1e-3);
      const at = (value) => 50 + 50 * Math.max(-1, Math.min(1, value / reach));
      // Three sigma are rare, and worth red; what is called a bound is one.
      const slack = card.gauge.what === '2σ' ? 1.5 : 1;
      return { truth: `${at(-off)}%`, left: `${at(low)}%`, width: `${at(high) - at(low)}%`, outside: -off < slack * low || -off > slack * high };
    },
    filter(text, update) { update(() => { this.waveformFilter = text; }); },
    async switch_(item) {
      this.busy = { ...this.busy, [item.name]: true };
      let problem = '';
      try {
        const answer = await fetch('/switch', {
          method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify({ node: item.name, on: !item.on }),
        });
        problem = (await answer.json()).problem;
      } catch (error) { problem = 'the viewer does not answer'; }
      this.busy = { ...this.busy, [item.name]: false };
      const done = `${item.name} is switched ${item.on ? 'off' : 'on'}`;
      this.$q.notify({ message: problem ? `${item.name}: ${problem}` : done, color: problem ? 'negative' : 'positive', position: 'bottom' });
      this.soon();
    },
  },
};
