/* The flight of bodies of several modes, in all lanes at once: cells of one length in which no contact is met. */
#include "lanes/rounds.h"

/* State of the lanes of a vector: the unforced motion of the modes, and the phase of the force. */
typedef struct {
    vector q[VI_REAL_MODES], p[VI_REAL_MODES], cosine, sine;
} modal_state;

/* Motion of a contact at the start of a cell. The displacement from its stop is positive beyond the stop; `bulge` is its
 * largest deviation from a cubic over the cell. */
typedef struct {
    vector y, v; /* displacement, velocity */
    vector bulge;
} contact_motion;

/* Values at the start of a round and at the ends of its cells. */
typedef vector edges[VI_CELLS + 1];

/* The lanes of a vector over the cells of a round. */
typedef struct {
    edges q[VI_REAL_MODES], p[VI_REAL_MODES], cosine, sine;
    edges y[VI_POINTS], v[VI_POINTS]; /* displacements of the points from their stops, and velocities */
} cells_ahead;

/* The lanes of a vector after the cells that are certified to be without contact. */
typedef struct {
    modal_state now;
    vector passed;                             /* whole cells */
    contact_motion contact[VI_LANES_CONTACTS]; /* over the next cell */
    mask met[VI_LANES_CONTACTS];               /* the contact may be met in the next cell */
} certified_flight;

/* ---- one step ---- */

LANES_INLINE void step_on(int at, int modes, const vi_lane_array step[][4], const double turn_cosine[],
                          const double turn_sine[], const modal_state *s, modal_state *next)
{
    const vector c = load(turn_cosine + at), n = load(turn_sine + at);
    for (int j = 0; j < modes; ++j) {
        next->q[j] = load(step[j][0] + at) * s->q[j] + load(step[j][1] + at) * s->p[j];
        next->p[j] = load(step[j][2] + at) * s->q[j] + load(step[j][3] + at) * s->p[j];
    }
    next->cosine = s->cosine * c - s->sine * n;
    next->sine = s->sine * c + s->cosine * n;
}

LANES_INLINE void contact_at(const vi_lane_group *g, int at, int modes, int c, const modal_state *s, vector *y,
                             vector *v)
{
    const vi_many_modes *many = &g->many;
    const vector a = load(many->cosine[c] + at), b = load(many->sine[c] + at);
    *y = (a * s->cosine + b * s->sine) + load(many->offset[c] + at);
    *v = load(g->angular_frequency + at) * (b * s->cosine - a * s->sine);
    for (int j = 0; j < modes; ++j) {
        const vector shape = load(many->shape[c][j] + at);
        *y += shape * s->q[j];
        *v += shape * s->p[j];
    }
}

/* ---- the cells of a round ---- */

LANES_INLINE void turn_ahead(vector c, vector n, edges cosine, edges sine)
{
#pragma GCC unroll 8
    for (int i = 1; i <= VI_CELLS; ++i) {
        cosine[i] = cosine[i - 1] * c - sine[i - 1] * n;
        sine[i] = sine[i - 1] * c + cosine[i - 1] * n;
    }
}

LANES_INLINE void mode_ahead(const vi_lane_array step[4], int at, edges q, edges p)
{
    const vector qq = load(step[0] + at), qp = load(step[1] + at), pq = load(step[2] + at), pp = load(step[3] + at);
#pragma GCC unroll 8
    for (int i = 1; i <= VI_CELLS; ++i) {
        q[i] = qq * q[i - 1] + qp * p[i - 1];
        p[i] = pq * q[i - 1] + pp * p[i - 1];
    }
}

LANES_INLINE void contact_ahead(const vi_lane_group *g, int at, int modes, int c, cells_ahead *ahead)
{
    const vi_many_modes *many = &g->many;
    const vector a = load(many->cosine[c] + at), b = load(many->sine[c] + at), offset = load(many->offset[c] + at);
    const vector w = load(g->angular_frequency + at);
    edges y, v; /* in registers */
#pragma GCC unroll 9
    for (int i = 0; i <= VI_CELLS; ++i) {
        y[i] = (a * ahead->cosine[i] + b * ahead->sine[i]) + offset;
        v[i] = w * (b * ahead->cosine[i] - a * ahead->sine[i]);
    }
    for (int j = 0; j < modes; ++j) {
        const vector shape = load(many->shape[c][j] + at), *q = ahead->q[j], *p = ahead->p[j];
#pragma GCC unroll 9
        for (int i = 0; i <= VI_CELLS; ++i) {
            y[i] += shape * q[i];
            v[i] += shape * p[i];
        }
    }
#pragma GCC unroll 9
    for (int i = 0; i <= VI_CELLS; ++i) {
        ahead->y[c][i] = y[i];
        ahead->v[c][i] = v[i];
    }
}

LANES_INLINE vector bulge_of(const vi_lane_group *g, int at, int modes, int c, const vector amplitude[])
{
    const vi_lane_array *row = g->many.present.bulge[c];
    vector bulge = load(row[modes] + at);
    for (int j = 0; j < modes; ++j) {
        bulge += load(row[j] + at) * amplitude[j];
    }
    return bulge;
}

/* ---- the certificate ---- */

/* Does a contact certainly stay below its stop in a cell? The control points of the cubic through the ends of the cell do,
 * by more than the deviation from the cubic. `third` is a third of the cell. */
LANES_INLINE mask stays_below(const contact_motion *from, vector end_y, vector end_v, vector third, vector bulge)
{
    const vector limit = -bulge;
    return (from->y < limit) & (from->y + third * from->v < limit) & (end_y - third * end_v < limit) & (end_y < limit);
}

/* Does a contact just left certainly come away in a cell? Its mean velocity since then stays negative: the same points
 * over the time, and the deviation over the time. */
LANES_INLINE mask comes_away(const contact_motion *from, vector end_y, vector end_v, vector third, vector bulge)
{
    const vector limit = -2.4 * bulge; /* 384 / 162 < 2.4: largest s (1 - s)^2 over largest s^2 (1 - s)^2 */
    return (3.0 * (third * from->v) < limit) & (1.5 * (end_y - third * end_v) < limit) & (end_y < limit);
}

/* Count the cells that each lane certainly passes, up to `most`. */
LANES_INLINE void count_cells(const vi_lane_group *g, int at, int contacts, const cells_ahead *ahead, vector most,
                              certified_flight *s)
{
    const vector third = load(g->many.present.cells + at) * load(g->cell + at) * (1.0 / 3.0), on = load(g->on + at);
    const mask shortest = load(g->many.level + at) == load(g->many.last + at), never = on != on;
    mask goes = ~never;
    s->passed = all(0.0);
    for (int c = 0; c < contacts; ++c) {
        s->met[c] = never;
    }
#pragma GCC unroll 8
    for (int i = 1; i <= VI_CELLS; ++i) {
        mask clear = ~never;
        for (int c = 0; c < contacts; ++c) {
            const contact_motion from = {ahead->y[c][i - 1], ahead->v[c][i - 1], s->contact[c].bulge};
            const vector end_y = ahead->y[c][i], end_v = ahead->v[c][i];
            mask passes = stays_below(&from, end_y, end_v, third, from.bulge);
            if (i == 1) { /* deviations over the time hold for the shortest cells alone */
                const mask here = on == (double)(c + 1);
                const mask away = comes_away(&from, end_y, end_v, third, from.bulge) & shortest;
                passes = (passes & ~here) | (away & here);
            }
            s->met[c] |= goes & ~passes;
            clear &= passes;
        }
        goes &= clear & (most >= (double)i);
        s->passed += only(goes, all(1.0));
    }
}

/* Values at the edges that the lanes have reached. */
LANES_INLINE vector reached(const edges values, const int row[])
{
    vector found;
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        found[i] = values[row[i]][i];
    }
    return found;
}

/* Fly up to `most` cells, from the state at the first edges. */
LANES_INLINE void fly(const vi_lane_group *g, int at, int modes, int contacts, const vector amplitude[], vector most,
                      cells_ahead *ahead, certified_flight *s)
{
    int row[VI_WIDTH];
    const vi_level_rows *rows = &g->many.present;
    turn_ahead(load(rows->turn_cosine + at), load(rows->turn_sine + at), ahead->cosine, ahead->sine);
    for (int j = 0; j < modes; ++j) {
        mode_ahead(rows->step[j], at, ahead->q[j], ahead->p[j]);
    }
    for (int c = 0; c < contacts; ++c) {
        contact_ahead(g, at, modes, c, ahead);
        s->contact[c].bulge = bulge_of(g, at, modes, c, amplitude);
    }
    count_cells(g, at, contacts, ahead, most, s);
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        row[i] = (int)s->passed[i];
    }
    for (int j = 0; j < modes; ++j) {
        s->now.q[j] = reached(ahead->q[j], row);
        s->now.p[j] = reached(ahead->p[j], row);
    }
    s->now.cosine = reached(ahead->cosine, row);
    s->now.sine = reached(ahead->sine, row);
    for (int c = 0; c < contacts; ++c) {
        s->contact[c].y = reached(ahead->y[c], row);
        s->contact[c].v = reached(ahead->v[c], row);
    }
}
