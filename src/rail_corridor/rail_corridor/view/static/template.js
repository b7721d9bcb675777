// What the page is made of; its drawing is done on the canvases.

export const template = `
<div class="cv" :data-status="status" :data-time="frame.t" :data-dark="dark">
  <header class="cv-head">
    <div class="cv-name"><strong>Rail corridor</strong><span v-if="line.name">{{ line.name }}</span></div>
    <div class="cv-status" :class="'is-' + status"><i></i>{{ statusText }}</div>
    <div class="cv-clock" v-if="frame.t !== undefined && trains.length" title="simulated time">{{ clock(frame.t, true) }}</div>
    <div class="cv-meta" v-if="line.name">seed {{ line.seed }} · tick {{ line.tick_s }} s · domain {{ domain }}</div>
    <div class="cv-fill"></div>
    <span class="cv-bad" v-if="frame.counts && (frame.counts.failed || frame.counts.error)" @click="tab = 'health'">
      ▲ {{ frame.counts.failed + frame.counts.error }} failed</span>
    <span class="cv-warn" v-if="frame.counts && frame.counts.warn" @click="tab = 'health'">{{ frame.counts.warn }} warning{{ frame.counts.warn > 1 ? 's' : '' }}</span>
    <q-btn flat round dense icon="help_outline" aria-label="What this page shows" @click="help = true"></q-btn>
    <q-btn flat round dense :icon="dark ? 'light_mode' : 'dark_mode'" :aria-label="dark ? 'Light colours' : 'Dark colours'" @click="toggleDark"></q-btn>
  </header>
  <div class="cv-banner" :class="'is-' + status" v-if="banner" role="status">{{ banner }}</div>

  <main v-if="status === 'waiting' && !trains.length && !line.name">
    <section class="cv-card cv-wait">
      <h2>No corridor is running yet</h2>
      <p>Start one in another terminal, on this machine and in the same ROS domain; this page follows it by itself.</p>
      <dl>
        <dt><code>rail run demo --rate 1</code></dt><dd>three trains on a line with a branch</dd>
        <dt><code>rail run moving_block --rate 1</code></dt><dd>trains controlled by radio; the first stops unexpectedly</dd>
        <dt><code>rail run located_block --rate 1</code></dt><dd>trains that find their place from all their sensors</dd>
        <dt><code>rail run follow_codes --rate 1</code></dt><dd>a train held off the one ahead by codes in the rails</dd>
      </dl>
      <p class="cv-sub">This viewer reads ROS domain {{ domain }}: start the corridor with <code>ROS_DOMAIN_ID={{ domain }}</code>, or the viewer with <code>--domain N</code>.</p>
    </section>
  </main>
  <main v-else-if="trains.length || line.name">
    <section class="cv-card cv-line">
      <div class="cv-row">
        <h2>Line <small v-if="line.description">{{ line.description }}</small></h2>
        <div class="cv-fill"></div>
        <q-btn-toggle v-model="asMap" unelevated no-caps padding="1px 9px" size="12px" toggle-color="primary"
          :options="[{label: 'strip', value: false}, {label: 'map', value: true}]" aria-label="How the line is drawn"></q-btn-toggle>
        <q-btn-toggle v-if="!asMap" v-model="span" unelevated no-caps padding="1px 9px" size="12px" toggle-color="primary" aria-label="How much of the line is drawn"
          :options="[{label: 'whole line', value: 0}, {label: '1 km', value: 1000}, {label: '100 m', value: 100}, {label: '5 m', value: 5}]"></q-btn-toggle>
      </div>
      <canvas ref="line" class="cv-canvas" role="img" aria-label="The line with its zones and trains; the table of trains says the same in words" @click="click"></canvas>
      <div class="cv-legend">
        <span v-for="[key, group] in groups" :key="key"><b class="swatch" :style="{background: group.colour}"></b>{{ group.legend }} {{ group.label }}</span>
        <span><b class="sign" :class="asMap ? 'dot' : 'train'"></b>train where it was measured</span>
        <span v-if="!asMap"><b class="sign truth"></b>where it truly is</span>
        <span v-if="!asMap"><b class="sign band"></b>± 2σ, to scale: see “5 m”</span>
        <span><b class="sign" :class="asMap ? 'ring' : 'unknown'"></b>position not known</span>
        <template v-if="!asMap"><span v-for="text in intervalLegend" :key="text"><b class="sign interval"></b>{{ text }}</span></template>
        <span v-if="hasAuthority && !asMap"><b class="sign grant"></b>movement authority</span>
        <template v-if="!asMap"><span v-for="row in rowLegend" :key="row.name"><b class="sign" :class="row.sign"></b>{{ row.text }}</span></template>
      </div>
    </section>

    <div class="cv-grid">
        <section class="cv-card cv-trains">
          <h2>Trains <small>measured{{ line.position_label ? ' by ' + line.position_label : '' }}; error = measured − true; pick one</small></h2>
          <div class="cv-scroll trains">
            <table class="cv-table trains">
              <thead><tr>
                <th>train</th><th class="num">position</th><th class="num">± 2σ <span class="unit">m</span></th>
                <th class="num" title="position said, minus the truth">error <span class="unit">m</span></th>
                <th v-for="column in columns.filter((c) => c.beside_position)" :key="column.key" class="num" :class="{wide: !column.always}" :title="column.hint">{{ column.heading }} <span class="unit">{{ column.unit }}</span></th>
                <th class="num"><span class="unit">km/h</span></th>
                <th v-for="column in columns.filter((c) => !c.beside_position)" :key="column.key" :class="{wide: !column.always}" :title="column.hint">{{ column.heading }} <span class="unit">{{ column.unit }}</span></th>
                <th v-if="supervised" class="wide">permitted</th>
              </tr></thead>
              <tbody>
                <tr v-for="item in trains" :key="item.name" :class="{picked: item.name === train, dim: !item.on}" @click="train = item.name" tabindex="0" @keydown.enter="train = item.name">
                  <td class="name">{{ item.name }}<div class="brake narrow">{{ braking(item) }}</div></td>
                  <td class="num" :class="{bad: item.on && !item.known}">{{ where(item) }}<span class="wide unit" v-if="item.known && (line.tracks || []).length > 1">&nbsp;{{ item.track }}</span></td>
                  <td class="num">{{ item.on && item.known ? (2 * item.sigma_m).toFixed(2) : '–' }}</td>
                  <td class="num">{{ item.on && item.known ? signed(item.error_m, 2) : '–' }}</td>
                  <td v-for="column in columns.filter((c) => c.beside_position)" :key="column.key" class="num" :class="[cell(item, column).tone, {wide: !column.always}]">{{ cell(item, column).text }}<div v-if="cell(item, column).note" class="note">{{ cell(item, column).note }}</div></td>
                  <td class="num">{{ item.on ? Math.abs(item.speed_kmh).toFixed(0) : '–' }}</td>
                  <td v-for="column in columns.filter((c) => !c.beside_position)" :key="column.key" :class="[cell(item, column).tone, {wide: !column.always}]"><span :class="{pair: cell(item, column).group != null}" :style="colourOf(cell(item, column).group)">{{ cell(item, column).text }}</span><div v-if="cell(item, column).note" class="note">{{ cell(item, column).note }}</div></td>
                  <td v-if="supervised" class="wide"><span v-if="item.permitted_kmh != null">{{ item.permitted_kmh }} km/h </span><span class="brake" v-if="braking(item)">{{ braking(item) }}</span></td>
                </tr>
              </tbody>
            </table>
          </div>
        </section>
        <section class="cv-card cv-picked" v-if="picked">
          <h2>{{ picked.name }} <small>what each sensor says</small></h2>
          <div class="cv-row">
            <div class="cv-sub">{{ traced.caption }}</div>
            <div class="cv-fill"></div>
            <q-btn-toggle v-if="traces.length > 1" v-model="errorOf" unelevated no-caps padding="1px 9px" size="12px" toggle-color="primary" aria-label="Whose error is drawn"
              :options="traces.map(({label, value}) => ({label, value}))"></q-btn-toggle>
          </div>
          <canvas ref="error" class="cv-canvas" role="img" :aria-label="'Error over the last two minutes of ' + traced.label"></canvas>
          <div class="cv-sensors">
            <div v-for="card in frame.cards || []" :key="card.topic" class="sensor" :class="card.state">
              <div class="title">{{ card.title }}
                <em v-if="card.state === 'stale'">stale: {{ card.age_s.toFixed(1) }} s old</em>
                <em v-if="card.state === 'gone'">gone: nobody sends it; last {{ card.age_s.toFixed(1) }} s ago</em>
              </div>
              <dl><template v-for="(row, k) in card.rows" :key="k"><dt>{{ row[0] }}</dt><dd :class="{word: row[0] === 'word'}">{{ row[1] }} <span class="unit">{{ row[2] }}</span></dd></template></dl>
              <div v-if="card.gauge" class="gauge" :class="{outside: gauge(card).outside}">
                <div class="bar"><b class="half" :style="{left: gauge(card).left, width: gauge(card).width}"></b><b class="said"></b><b class="truth" :style="{left: gauge(card).truth}"></b></div>
                <span>{{ signed(card.gauge.off_m, 2) }} m off the truth; claims ± {{ card.gauge.half_m.toFixed(2) }} m ({{ card.gauge.what }})</span>
              </div>
              <div class="topic">{{ card.topic }}</div>
            </div>
          </div>
          <div v-if="(frame.diagnostics || []).length" class="cv-diag">
            <div v-for="item in frame.diagnostics" :key="item.name"><b :class="'level ' + item.level">{{ item.level }}</b> {{ item.name.replace('/' + train + '/', '') }}: {{ item.message }}</div>
          </div>
        </section>

      <section class="cv-card cv-main">
        <q-tabs v-model="tab" dense no-caps align="left" inline-label outside-arrows mobile-arrows>
          <q-tab v-for="item in tabs" :key="item.name" :name="item.name" :label="item.label"></q-tab>
        </q-tabs>

        <div v-if="tab === 'distance'">
          <div class="cv-row">
            <div class="cv-legend"><span><b class="sign path picked"></b>{{ train || 'picked train' }}</span><span><b class="sign path"></b>other trains, as measured</span><span><b class="sign path thin"></b>truth</span><span v-if="groups.size">edge: colours as on the line</span></div>
            <div class="cv-fill"></div>
            <q-btn-toggle v-model="last" unelevated no-caps padding="1px 9px" size="12px" toggle-color="primary" :options="[{label: 'all', value: 0}, {label: 'last 5 min', value: 300}, {label: 'last min', value: 60}]"></q-btn-toggle>
          </div>
          <canvas ref="distance" class="cv-canvas" role="img" aria-label="Time-distance chart of all trains"></canvas>
        </div>

        <div v-else-if="tab === 'scope'" class="cv-scope">
          <div class="cv-row">
            <q-select v-model="scopeTopic" :options="waveforms" dense outlined use-input hide-selected fill-input input-debounce="0" class="cv-pick" label="waveform topic" @filter="filter"></q-select>
            <q-btn-toggle v-if="scope && scope.antennas > 1" v-model="antenna" unelevated no-caps padding="1px 9px" size="12px" toggle-color="primary" :options="Array.from({length: scope.antennas}, (_, k) => ({label: 'antenna ' + (k + 1), value: k}))"></q-btn-toggle>
            <q-btn-toggle v-model="zoom" unelevated no-caps padding="1px 9px" size="12px" toggle-color="primary" :options="[{label: 'all', value: 1}, {label: '¼', value: 4}, {label: '1/16', value: 16}, {label: '1/64', value: 64}]"></q-btn-toggle>
          </div>
          <div class="cv-sub" v-if="!scope">Choose a topic that carries a waveform.</div>
          <div class="cv-sub bad" v-else-if="scope.problem">{{ scope.topic }}: {{ scope.problem }}{{ scope.writers ? '' : '; nobody sends it' }}</div>
          <template v-else>
            <div class="cv-sub">
              <b v-if="!scope.writers" class="bad">gone: nobody sends it any longer. </b>
              block of {{ clock(scope.stamp_s, true) }} ·
              <span v-if="scope.radio">CH{{ scope.channel }}, carrier {{ engineering(scope.carrier_hz, 'Hz', 5) }} · </span>{{ scope.samples }} samples at {{ engineering(scope.rate_hz, 'S/s') }}
              <span v-if="scope.power_dbm != null"> · mean power {{ signed(scope.power_dbm, 1).replace('+', '') }} {{ scope.radio ? 'dBm' : 'dBV' }}</span>
              <b v-if="scope.silent"> · silent: nothing is sent</b>
            </div>
            <div class="cv-plots" v-if="!scope.silent">
              <div><h3>Over time <small><b class="i">I</b><template v-if="!scope.real"> and <b class="q">Q</b></template></small></h3><canvas ref="time" class="cv-canvas"></canvas></div>
              <div><h3>Spectrum <small>Hann window, resolution {{ engineering(scope.spectrum.resolution_hz, 'Hz') }}</small></h3><canvas ref="spectrum" class="cv-canvas"></canvas></div>
              <div><h3>{{ kindOfPlane }}</h3><canvas ref="plane" class="cv-canvas"></canvas></div>
            </div>
          </template>
        </div>

        <div v-else-if="panel && panel.log">
          <p class="cv-sub" v-if="!panel.there">{{ panel.absent }}</p>
          <template v-else>
            <q-checkbox v-model="onlyPicked" dense size="sm" :label="'only those from or to ' + train"></q-checkbox>
            <div class="cv-scroll tall"><table class="cv-table telegrams"><thead><tr><th class="num">time</th><th>where seen</th><th>from → to</th><th>what</th><th class="num">no.</th></tr></thead>
              <tbody><tr v-for="item in shownTelegrams" :key="item.id"><td class="num">{{ clock(item.t, true) }}</td><td>{{ item.stage }}<br><small>{{ item.place }}</small></td><td>{{ item.from }} → {{ item.to }}</td><td><b>{{ item.kind }}</b> {{ item.text }}</td><td class="num">{{ item.seq }}</td></tr></tbody></table></div>
            <p class="cv-sub">{{ panel.note }}</p>
          </template>
        </div>

        <div v-else-if="panel">
          <p class="cv-sub" v-if="frame.panel === null">{{ panel.absent }}</p>
          <template v-else-if="frame.panel">
            <template v-if="frame.panel.cards.length">
              <h3>{{ frame.panel.cards_title }}</h3>
              <div class="cv-sensors"><div class="sensor" v-for="card in panelCards" :key="card.topic" :class="card.state"><dl><template v-for="(row, k) in card.rows" :key="k"><dt>{{ row[0] }}</dt><dd :class="{word: row[0] === 'word'}">{{ row[1] }} <span class="unit">{{ row[2] }}</span></dd></template></dl></div></div>
            </template>
            <h3>{{ frame.panel.title }}</h3>
            <div class="cv-scroll"><table class="cv-table"><thead><tr><th v-for="(heading, k) in frame.panel.headings" :key="k" :class="{num: k > 1}">{{ heading[0] }} <span class="unit">{{ heading[1] }}</span></th></tr></thead>
              <tbody><tr v-for="(row, n) in frame.panel.rows" :key="n" :class="{picked: frame.panel.picked[n]}"><td v-for="(cell, k) in row" :key="k" :class="{name: k === 0, num: k > 1 && !filling(row, k)}" :colspan="filling(row, k) ? frame.panel.headings.length - k : 1">{{ cell[0] }} <span class="unit">{{ cell[1] }}</span></td></tr></tbody></table></div>
          </template>
        </div>

        <div v-else-if="tab === 'health'">
          <div v-for="item in health.failed" :key="item.node" class="cv-failed"><b class="level error">failed</b> <b>{{ item.node }}</b>: {{ item.reason }}<small v-if="item.by"> (says {{ item.by }}, at {{ clock(item.t) }})</small></div>
          <h3>What nodes say of themselves</h3>
          <div class="cv-scroll"><table class="cv-table"><tbody><tr v-for="item in health.status" :key="item.name"><td><b :class="'level ' + item.level">{{ item.level }}</b></td><td class="name">{{ item.name }}</td><td>{{ item.message }}<small v-for="value in item.values" :key="value"><br>{{ value }}</small></td><td class="num">{{ item.t ? clock(item.t) : '–' }}</td></tr></tbody></table></div>
          <h3>What has changed, newest first</h3>
          <div class="cv-scroll"><table class="cv-table"><tbody><tr v-for="(item, k) in health.events" :key="k"><td class="num">{{ item.t ? clock(item.t, true) : '–' }}</td><td><b :class="'level ' + item.level">{{ item.level }}</b></td><td class="name">{{ item.name }}</td><td>{{ item.text }}</td></tr></tbody></table>
            <p class="cv-sub" v-if="!health.events.length">nothing yet</p></div>
        </div>

        <div v-else-if="tab === 'faults'">
          <h3>Switch equipment off and on</h3>
          <p class="cv-sub" v-if="!lists.equipment.length">The nodes of this corridor offer no switches: with many of them in one process they are left out. Start it with <code>rail run … --switches</code> (a run with <code>--rate</code> has them by itself), or with <code>--processes site</code>.</p>
          <template v-else>
            <p class="cv-sub">Equipment that is switched off is silent, or says that it knows nothing; it is done by the standard lifecycle service <code>change_state</code>. This changes the run: its report will differ.</p>
            <q-input v-model="wish" dense outlined clearable label="find equipment" class="cv-pick"></q-input>
            <div class="cv-scroll tall"><div v-for="item in equipment" :key="item.name" class="cv-switch">
              <b :class="'level ' + (item.failed ? 'error' : item.on ? 'ok' : 'warn')">{{ item.failed ? 'failed' : item.on ? 'on' : 'off' }}</b><span class="name">{{ item.name }}</span>
              <q-btn dense unelevated no-caps size="12px" :color="item.on ? 'negative' : 'positive'" :loading="busy[item.name]" :disable="item.failed" :label="item.on ? 'switch off' : 'switch on'" @click="switch_(item)"></q-btn></div></div>
          </template>
          <h3>Faults of the scenario</h3>
          <p class="cv-sub" v-if="!faults.length">none is planned</p>
          <table class="cv-table" v-else><tbody><tr v-for="(item, k) in faults" :key="k"><td><b :class="'level ' + (item.state === 'now' ? 'error' : 'ok')">{{ item.state }}</b></td><td class="name">{{ item.kind }} {{ item.what }}</td><td class="num">{{ clock(item.fault.from_s) }} to {{ item.fault.to_s >= 1e6 ? 'the end' : clock(item.fault.to_s) }}</td></tr></tbody></table>
          <p class="cv-sub">What else can go wrong is planned in the scenario (<code>faults:</code>) or on the command line (<code>rail run --kill NODE@S</code>).</p>
        </div>
      </section>
    </div>
  </main>

  <q-dialog v-model="help"><q-card class="cv-help"><h2>What this page shows</h2>
    <p v-for="text in line.introduction || []" :key="text">{{ text }}</p>
    <p>Pick a train in the table or on the line. “5 m” zooms until the uncertainty can be seen. Everything comes from ROS 2 topics, whose names stand under each sensor.</p>
    <p><b>stale</b>: the newest message is older than a few ticks. <b>gone</b>: nobody sends the topic any longer.</p>
    <q-btn v-close-popup flat no-caps color="primary" label="close"></q-btn></q-card></q-dialog>
</div>
`;
