/* The extremes of the observed displacement of bodies of several modes over a round, in all lanes at once. */
#include "lanes/many_search.h"

/* Pieces of a round: its cells, and the part of the next cell up to the end of a search. */
enum { PIECES = VI_CELLS + 1 };
/* Most crests and troughs of a round that are found in all lanes at once. */
enum { MOST_CRESTS = 4 };
/* Order of the Taylor terms in the first steps to a crest. */
enum { NEAR_ORDER = 8 };
/* Most cells of a round, longer than the shortest, that are followed in all lanes at once; most rounds for each. */
enum { MOST_LONG_CELLS = 3, MOST_BLOCKS = 2 };

/* The observed motion over a round: displacement and velocity at the start of each piece, at the end of the last one. */
typedef struct {
    const edges *x, *v;
    vector end_x, end_v;
    vector part;        /* length of the last piece, shortest cells */
    vector bulge, wave; /* largest deviations from a cubic over a cell: of the displacement; of a third of its slope */
    vector most, least;
} observed_motion;

/* Set the largest deviations of the observed displacement from a cubic over cells of this length, shortest cells. */
LANES_INLINE void take_deviations(const vi_lane_group *g, int at, int modes, const vector amplitude[], vector length,
                                  observed_motion *o)
{
    const vi_many_modes *many = &g->many;
    const vector square = length * length, fourth = square * square;
    o->bulge = o->wave = all(0.0);
    for (int j = 0; j <= modes; ++j) {
        const vector size = j < modes ? amplitude[j] : all(1.0), wave = load(many->wave[j] + at) * fourth;
        const vector most = load(many->flat[j] + at) + load(many->rise[j] + at) * length;
        o->wave += wave * size;
        o->bulge += smaller(wave, most) * size;
    }
    o->wave = 1.03 * o->wave; /* > 384 sqrt(3) / 648: deviation of a third of the slope over that of the displacement */
}

/* May the displacement have an extreme inside a piece that is none so far? `third`: a third of the piece, s. */
LANES_INLINE mask may_extend(const observed_motion *o, vector x, vector v, vector end_x, vector end_v, vector third)
{
    const vector rise = third * v, end_rise = third * end_v, first = x + rise, second = end_x - end_rise;
    const vector middle = second - first, wave = o->wave;
    const mask rises = (rise > wave) & (middle > wave) & (end_rise > wave);
    const mask falls = (rise < -wave) & (middle < -wave) & (end_rise < -wave);
    const mask within = (larger(first, second) + o->bulge <= o->most) & (smaller(first, second) - o->bulge >= o->least);
    return ~(rises | falls | within);
}

/* Extend the range by the ends of all pieces, and find the pieces that may extend it inside. `cells`: length of a cell. */
LANES_INLINE void extend_by_ends(const vi_lane_group *g, int at, vector cells, vector passed, mask lanes,
                                 observed_motion *o, mask doubtful[])
{
    const vector cell = load(g->cell + at), third = cells * cell * (1.0 / 3.0);
    for (int i = 0; i <= VI_CELLS; ++i) {
        const mask in = lanes & (passed >= (double)i);
        o->most = choose(in, larger((*o->x)[i], o->most), o->most);
        o->least = choose(in, smaller((*o->x)[i], o->least), o->least);
    }
    o->most = choose(lanes, larger(o->end_x, o->most), o->most);
    o->least = choose(lanes, smaller(o->end_x, o->least), o->least);
    for (int i = 1; i <= PIECES; ++i) {
        const mask last = passed == (double)(i - 1);
        const vector end_x = i <= VI_CELLS ? choose(last, o->end_x, (*o->x)[i <= VI_CELLS ? i : 0]) : o->end_x;
        const vector end_v = i <= VI_CELLS ? choose(last, o->end_v, (*o->v)[i <= VI_CELLS ? i : 0]) : o->end_v;
        const vector length = choose(last, o->part * cell * (1.0 / 3.0), third);
        doubtful[i - 1] = may_extend(o, (*o->x)[i - 1], (*o->v)[i - 1], end_x, end_v, length) & lanes
                          & ((passed >= (double)i) | (last & (o->part > 0.0)));
    }
}

/* Find the crest or trough of one piece in each lane. The piece begins at the edge `row`; its middle is that of two
 * shortest cells, where the motion is expanded. Returns the lanes in which it is found, or certainly absent. */
LANES_INLINE mask extend_by_crest(const vi_lane_group *g, int at, int modes, const cells_ahead *ahead, const int row[],
                                  vector length, mask wanted, observed_motion *o)
{
    const vi_many_modes *many = &g->many;
    modal_state start, middle;
    derivatives d;
    vector term[VI_LANE_ORDER + 1];
    for (int j = 0; j < modes; ++j) {
        start.q[j] = reached(ahead->q[j], row);
        start.p[j] = reached(ahead->p[j], row);
    }
    start.cosine = reached(ahead->cosine, row);
    start.sine = reached(ahead->sine, row);
    step_on(at, modes, many->half, many->half_cosine, many->half_sine, &start, &middle);
    expand_modes(g, at, modes, &middle, &d);
    const vector third = expand_point(g, at, modes, VI_LANES_CONTACTS, many->offset, &middle, &d, term);
    const vector second = 2.0 * term[2];
    const mask concave = -second > third, convex = second > third;
    const vector low = all(-1.0), high = length - 1.0;
    const vector first_slope = motion_by(term, VI_LANE_ORDER, low).slope;
    const vector last_slope = motion_by(term, VI_LANE_ORDER, high).slope;
    const mask inside = (concave & (first_slope > 0.0) & (last_slope < 0.0))
                        | (convex & (first_slope < 0.0) & (last_slope > 0.0));
    vector share = low + length * (first_slope / (first_slope - last_slope));
    for (int i = 0; i < 2; ++i) {
        const motion_at near = motion_by(term, NEAR_ORDER, share);
        share = smaller(larger(share - near.slope / (2.0 * near.bend), low), high);
    }
    const motion_at m = motion_by(term, VI_LANE_ORDER, share);
    const vector step = -(m.slope / (2.0 * m.bend));
    /* the last step moves on a parabola */
    const vector x = (term[0] + m.added) + 0.5 * (m.slope * step);
    const mask found = wanted & inside & (size_of(step) <= 1e-5);
    o->most = choose(found & concave, larger(x, o->most), o->most);
    o->least = choose(found & convex, smaller(x, o->least), o->least);
    return wanted & (found | ((concave | convex) & ~inside));
}

/* First doubtful piece of each of these lanes, from 1; 0: none. */
LANES_INLINE vector first_doubtful(mask lanes, const mask doubtful[])
{
    vector piece = all(0.0);
    for (int i = PIECES; i >= 1; --i) {
        piece = choose(lanes & doubtful[i - 1], all((double)i), piece);
    }
    return piece;
}

/* Edges at which the pieces of the lanes begin. */
LANES_INLINE void edge_of(vector piece, int row[])
{
#pragma GCC unroll 8
    for (int i = 0; i < VI_WIDTH; ++i) {
        row[i] = piece[i] > 0.0 ? (int)piece[i] - 1 : 0;
    }
}

/* Find the crests and troughs of doubtful pieces of two shortest cells or less, which are doubtful no more. */
static void find_crests(const vi_lane_group *g, int at, int modes, const cells_ahead *ahead, vector passed, mask lanes,
                        observed_motion *o, mask doubtful[])
{
    for (int k = 0; k < MOST_CRESTS; ++k) {
        const vector piece = first_doubtful(lanes, doubtful);
        const mask wanted = piece > 0.0;
        if (!any(wanted)) {
            return;
        }
        int row[VI_WIDTH];
        edge_of(piece, row);
        const vector length = choose(piece == passed + 1.0, o->part, all(2.0));
        const mask done = extend_by_crest(g, at, modes, ahead, row, length, wanted, o);
        lanes &= ~wanted | done;
        for (int i = 1; i <= PIECES; ++i) {
            doubtful[i - 1] &= ~(done & (piece == (double)i));
        }
    }
}

LANES_INLINE mask is_any(const mask doubtful[])
{
    mask found = doubtful[0];
    for (int i = 1; i < PIECES; ++i) {
        found |= doubtful[i];
    }
    return found;
}

/* Extend the range over one longer cell of some lanes, which begins at the first edges: in cells of two shortest ones.
 * Returns the lanes in which it is not extended. */
LANES_INLINE mask extend_over_cell(const vi_lane_group *g, int at, int modes, mask lanes, cells_ahead *fine,
                                   observed_motion *o)
{
    const vi_many_modes *many = &g->many;
    vector left = only(lanes, 0.5 * load(many->present.cells + at));
    mask failed = lanes & (left > (double)(MOST_BLOCKS * VI_CELLS));
    left = only(~failed, left);
    for (int block = 0; block < MOST_BLOCKS && any(left > 0.0); ++block) {
        mask doubtful[PIECES];
        const mask goes = left > 0.0;
        const vector cells = smaller(left, all((double)VI_CELLS));
        turn_ahead(load(many->two_cosine + at), load(many->two_sine + at), fine->cosine, fine->sine);
        for (int j = 0; j < modes; ++j) {
            mode_ahead(many->two[j], at, fine->q[j], fine->p[j]);
        }
        contact_ahead(g, at, modes, VI_LANES_CONTACTS, fine);
        o->end_x = (*o->x)[0];
        o->end_v = (*o->v)[0];
        extend_by_ends(g, at, all(2.0), cells, goes, o, doubtful);
        find_crests(g, at, modes, fine, cells, goes, o, doubtful);
        failed |= is_any(doubtful);
        left -= cells;
        for (int j = 0; j < modes; ++j) {
            fine->q[j][0] = fine->q[j][VI_CELLS];
            fine->p[j][0] = fine->p[j][VI_CELLS];
        }
        fine->cosine[0] = fine->cosine[VI_CELLS];
        fine->sine[0] = fine->sine[VI_CELLS];
    }
    return failed;
}

/* Extend the range over doubtful cells that are longer than two shortest cells; they are doubtful no more. */
static void extend_over_cells(const vi_lane_group *g, int at, int modes, const vector amplitude[],
                              const cells_ahead *ahead, mask lanes, observed_motion *o, mask doubtful[])
{
    cells_ahead fine;
    observed_motion f = {.x = &fine.y[VI_LANES_CONTACTS], .v = &fine.v[VI_LANES_CONTACTS], .part = all(0.0)};
    take_deviations(g, at, modes, amplitude, all(2.0), &f);
    f.most = o->most;
    f.least = o->least;
    for (int k = 0; k < MOST_LONG_CELLS; ++k) {
        const vector piece = first_doubtful(lanes, doubtful);
        const mask wanted = piece > 0.0;
        if (!any(wanted)) {
            break;
        }
        int row[VI_WIDTH];
        edge_of(piece, row);
        for (int j = 0; j < modes; ++j) {
            fine.q[j][0] = reached(ahead->q[j], row);
            fine.p[j][0] = reached(ahead->p[j], row);
        }
        fine.cosine[0] = reached(ahead->cosine, row);
        fine.sine[0] = reached(ahead->sine, row);
        const mask failed = extend_over_cell(g, at, modes, wanted, &fine, &f);
        lanes &= ~failed;
        for (int i = 1; i <= PIECES; ++i) {
            doubtful[i - 1] &= ~(wanted & ~failed & (piece == (double)i));
        }
    }
    o->most = f.most;
    o->least = f.least;
}

/* Extend the extremes of the open periods over the round; returns the lanes that need the careful search of crests. */
LANES_INLINE mask extend_range(vi_lane_group *g, int at, int modes, const vector amplitude[], cells_ahead *ahead,
                               const modal_state *now, vector passed, vector part)
{
    const mask followed = load(g->record.extremes + at) > 0.0;
    const vector cells = load(g->many.present.cells + at);
    observed_motion o = {.x = &ahead->y[VI_LANES_CONTACTS], .v = &ahead->v[VI_LANES_CONTACTS], .part = part};
    modal_state end = *now;
    mask doubtful[PIECES];
    contact_ahead(g, at, modes, VI_LANES_CONTACTS, ahead);
    turn(load(g->angular_frequency + at) * load(g->rest + at), &end.cosine, &end.sine);
    contact_at(g, at, modes, VI_LANES_CONTACTS, &end, &o.end_x, &o.end_v);
    take_deviations(g, at, modes, amplitude, cells, &o);
    o.most = load(g->record.most + at);
    o.least = load(g->record.least + at);
    extend_by_ends(g, at, cells, passed, followed, &o, doubtful);
    const mask shortest = cells == 2.0;
    if (any(is_any(doubtful) & shortest)) {
        find_crests(g, at, modes, ahead, passed, shortest, &o, doubtful);
    }
    if (any(is_any(doubtful) & ~shortest)) {
        extend_over_cells(g, at, modes, amplitude, ahead, ~shortest, &o, doubtful);
    }
    store(g->record.most + at, choose(followed, o.most, load(g->record.most + at)));
    store(g->record.least + at, choose(followed, o.least, load(g->record.least + at)));
    return is_any(doubtful);
}
