// Surfaces of moved and cut bodies. A plane cuts the undeformed bodies: {axis, place, side}; side = 1 keeps
// what lies below the place, -1 what lies above.

const SIX = [
  [0, 1, 2, 6],
  [0, 2, 3, 6],
  [0, 3, 7, 6],
  [0, 7, 4, 6],
  [0, 4, 5, 6],
  [0, 5, 1, 6],
];
const ONE = [[0, 1, 2, 3]];

class Surface {
  // Triangles for plotly; values are one per vertex or, "cellwise", one per triangle.
  constructor() {
    Object.assign(this, { x: [], y: [], z: [], i: [], j: [], k: [], values: [] });
  }

  vertex(position, value) {
    this.x.push(position[0]);
    this.y.push(position[1]);
    this.z.push(position[2]);
    if (value !== undefined) this.values.push(value);
    return this.x.length - 1;
  }

  triangle(a, b, c, value) {
    this.i.push(a);
    this.j.push(b);
    this.k.push(c);
    if (value !== undefined) this.values.push(value);
  }
}

class Shape {
  // A body at one scale of its displacement, with values on nodes or cells, and its distances from a plane.
  constructor(body, scale, plane, values, cellwise) {
    Object.assign(this, { body, values, cellwise });
    const points = body.points.values,
      moves = body.nodes.displacement && body.nodes.displacement.values;
    this.positions = moves && scale ? points.map((x, n) => x + scale * moves[n]) : points;
    this.distance = null;
    if (plane) {
      this.distance = new Float32Array(points.length / 3);
      for (let n = 0; n < this.distance.length; n++) {
        this.distance[n] = plane.side * (points[3 * n + plane.axis] - plane.place);
      }
    }
  }

  position(a, b, part) {
    const p = this.positions;
    return [0, 1, 2].map((axis) => p[3 * a + axis] + part * (p[3 * b + axis] - p[3 * a + axis]));
  }

  value(a, b, part) {
    if (this.cellwise || !this.values) return undefined;
    return this.values[a] + part * (this.values[b] - this.values[a]);
  }

  crossing(a, b) {
    return [a, b, this.distance[a] / (this.distance[a] - this.distance[b])];
  }

  vertex(surface, [a, b, part]) {
    return surface.vertex(this.position(a, b, part), this.value(a, b, part));
  }

  ofCell(cell) {
    return this.cellwise && this.values ? this.values[cell] : undefined;
  }

  // The skin, or its part on one side of the plane; only those triangles of which all nodes are wanted.
  addSkin(surface, wanted) {
    const nodes = this.body.triangles.values,
      owner = this.body.owner.values;
    const places = new Int32Array(this.positions.length / 3).fill(-1);
    const whole = (n) => {
      if (places[n] < 0) places[n] = this.vertex(surface, [n, n, 0]);
      return places[n];
    };
    for (let t = 0; t < owner.length; t++) {
      const corners = [nodes[3 * t], nodes[3 * t + 1], nodes[3 * t + 2]];
      if (wanted && !corners.every((n) => wanted[n] >= 0)) continue;
      const kept = this.distance ? corners.filter((n) => this.distance[n] <= 0).length : 3;
      if (kept === 3) {
        surface.triangle(...corners.map(whole), this.ofCell(owner[t]));
      } else if (kept > 0) {
        this.addPolygon(surface, this.below(corners), owner[t]);
      }
    }
  }

  // Corners of the part of a polygon below the plane.
  below(corners) {
    const kept = [];
    corners.forEach((n, place) => {
      const next = corners[(place + 1) % corners.length];
      if (this.distance[n] <= 0) kept.push([n, n, 0]);
      if (this.distance[n] <= 0 !== this.distance[next] <= 0) kept.push(this.crossing(n, next));
    });
    return kept;
  }

  addPolygon(surface, corners, cell) {
    const numbers = corners.map((corner) => this.vertex(surface, corner));
    for (let n = 2; n < numbers.length; n++) {
      surface.triangle(numbers[0], numbers[n - 1], numbers[n], this.ofCell(cell));
    }
  }

  // The faces where the plane cuts the cells, each taken as tetrahedra.
  addCut(surface) {
    const { values: cells, columns } = this.body.cells;
    for (let cell = 0; cell < cells.length / columns; cell++) {
      const corners = cells.subarray(columns * cell, columns * (cell + 1));
      let below = 0;
      for (const n of corners) below += this.distance[n] <= 0;
      if (below === 0 || below === columns) continue;
      for (const four of columns === 8 ? SIX : ONE) {
        const inside = [],
          outside = [];
        for (const n of four) (this.distance[corners[n]] <= 0 ? inside : outside).push(corners[n]);
        if (!inside.length || !outside.length) continue;
        const ring =
          inside.length === 2
            ? [
                [0, 0],
                [0, 1],
                [1, 1],
                [1, 0],
              ].map(([a, b]) => this.crossing(inside[a], outside[b]))
            : inside.flatMap((a) => outside.map((b) => this.crossing(a, b)));
        this.addPolygon(surface, ring, cell);
      }
    }
  }

  // Lines between nodes, cut like the skin; with values where lines are coloured.
  addLines(lines, pairs, wanted) {
    for (let n = 0; n < pairs.length; n += 2) {
      const ends = [pairs[n], pairs[n + 1]];
      if (wanted && !ends.every((end) => wanted[end] >= 0)) continue;
      const line = this.distance ? this.below(ends) : ends.map((end) => [end, end, 0]);
      if (line.length < 2) continue;
      for (const place of line.slice(0, 2)) this.vertex(lines, place);
      lines.vertex([null, null, null], this.value(ends[0], ends[0], 0));
    }
  }
}
