/* Eight lanes: the states of their bodies, and tables of their motion; arrays end in [lane], as vector registers need.
 *
 * Each lane has cells of time of one length. The motion over a cell is a Taylor polynomial in the share of the cell. It
 * is linear in (q, p, cosine, sine, 1) at the start, with a table of coefficients for each of the five. So are the
 * states at the ends of the next VI_CELLS cells. Resonance, critical damping and slow forcing are no special cases, as
 * no steady response is needed.
 */
#ifndef VIBROIMPACT_LANE_GROUP_H
#define VIBROIMPACT_LANE_GROUP_H

#include <stddef.h>
#include <stdint.h>

#include "lanes/lane_points.h"

/* VI_CELLS: of a round. VI_PAIRS: pairs of cells of a round of one mode between rigid stops; they reach over a period of
 * the fastest rate. VI_NEAR_PAIRS: first ones, with bounds of their own. VI_LANE_ORDER: of the Taylor series.
 * VI_SINE_ORDER: of those of further sines of one mode, whose frequencies may be higher. */
enum { VI_LANES = 8, VI_CELLS = 8, VI_PAIRS = 9, VI_NEAR_PAIRS = 4, VI_LANE_ORDER = 14, VI_SINE_ORDER = 18 };

/* Speed of a rebound, relative to the largest approach, below which a chatter may end, as in chatter.c. */
#define VI_LANE_TAIL 1e-4

/* Parts in which a motion is linear, in the order of the tables. */
enum { VI_OF_Q, VI_OF_P, VI_OF_COSINE, VI_OF_SINE, VI_OF_ONE, VI_PARTS };

/* Events of a lane that need more than lockstep. */
enum {
    VI_EVENT_NONE = 0,
    VI_EVENT_IMPACT = 1, /* an impact at the impact limit */
    VI_EVENT_GOAL = 2,   /* the lane has reached its goal, which is not the start of another whole recorded period */
    VI_EVENT_CELL = 3,   /* the cell that begins here needs the careful search */
    VI_EVENT_LEAVE = 4,  /* the point is left to the scalar engine */
    VI_EVENT_FLIGHT = 5  /* no event, but the extremes of the round are doubtful */
};

typedef double vi_lane_array[VI_LANES];

/* Tables of a body of one mode. Its motion over a cell is linear in the five parts at the start. */
typedef struct {
    vi_lane_array taylor[VI_LANE_ORDER + 1][VI_PARTS]; /* of q over a cell */
    /* the same over a pair of cells, about its middle, in the share of the pair less 1/2; between rigid stops */
    vi_lane_array middle[VI_LANE_ORDER + 1][VI_PARTS];
    /* bounds of the third and fourth derivatives of q over the near pairs, and over all, in units of a pair. Each is a
     * number, and factors of |q| and |p| at the start. */
    vi_lane_array third_by[2][3], fourth_by[2][3];
    /* after whole cells, and turn of the force; after more than VI_CELLS cells: of pairs between rigid stops */
    vi_lane_array end_q[2 * VI_PAIRS + 1][VI_PARTS], end_p[2 * VI_PAIRS + 1][VI_PARTS];
    vi_lane_array turn_cosine[2 * VI_PAIRS + 1], turn_sine[2 * VI_PAIRS + 1];
    vi_lane_array stiffness, drag, root_rate; /* 2 decay, 2 decay + natural */
    vi_lane_array load, fastest_load;         /* |forces| + |held|; largest angular frequency of a force */
    vi_lane_array span;                       /* VI_CELLS cells, s */
} vi_one_mode;

/* Parts in which a motion is linear for each further sine. */
enum { VI_OF_ITS_COSINE, VI_OF_ITS_SINE, VI_SINE_PARTS };

/* Sines of the lanes besides the first: their phases from the clock, and their shares of the tables of a body. */
typedef struct vi_lane_sines {
    vi_lane_array angular_frequency[VI_FURTHER_SINES], rate[VI_FURTHER_SINES]; /* rad/s; turns in a second */
    vi_lane_array turn[VI_FURTHER_SINES];     /* at the start of the clock's period 0 */
    /* Turns in a period of the clock, less whole turns: multiples of 2^-27 and of 2^-54, and a rest. Products of the
     * first two with a number of periods are exact. */
    vi_lane_array turns[VI_FURTHER_SINES][3];
    /* Multiple of the clock's frequency, 0 if it is none; drift from this multiple, rad for each rad of the clock. Cosine
     * and sine of the phase at the start of the clock's period 0. */
    vi_lane_array harmonic[VI_FURTHER_SINES], drift[VI_FURTHER_SINES];
    vi_lane_array start_cosine[VI_FURTHER_SINES], start_sine[VI_FURTHER_SINES];
    /* of one mode, as in vi_one_mode */
    vi_lane_array taylor[VI_SINE_ORDER + 1][VI_FURTHER_SINES][VI_SINE_PARTS];
    vi_lane_array middle[VI_SINE_ORDER + 1][VI_FURTHER_SINES][VI_SINE_PARTS];
    vi_lane_array end_q[2 * VI_PAIRS + 1][VI_FURTHER_SINES][VI_SINE_PARTS];
    vi_lane_array end_p[2 * VI_PAIRS + 1][VI_FURTHER_SINES][VI_SINE_PARTS];
    vi_lane_array turned[2 * VI_PAIRS + 1][VI_FURTHER_SINES][VI_SINE_PARTS]; /* cosine and sine of its own turn */
    /* of several modes: the steady response of each real mode */
    vi_lane_array steady[VI_FURTHER_SINES][VI_REAL_MODES][VI_SINE_PARTS];
    int64_t count;                            /* of further sines; the members before it are arrays over the lanes */
    int64_t highest, others;                  /* highest harmonic so far; number of sines so far that are none */
} vi_lane_sines;

/* Stops that yield, for a body of one mode. While a stop is pressed, the lane's q and p are the depth and its rate. */
typedef struct {
    vi_one_mode pressed[VI_ONE_MODE_CONTACTS];   /* tables of the depth while the stop is pressed */
    /* depth + lag * rate after whole cells: it has the sign of the force. The same of q, free, beyond the stop */
    vi_lane_array pressed_end[VI_ONE_MODE_CONTACTS][VI_CELLS + 1][VI_PARTS];
    vi_lane_array receding_end[VI_ONE_MODE_CONTACTS][VI_CELLS + 1][VI_PARTS];
    vi_lane_array cell[VI_ONE_MODE_CONTACTS + 1], cell_rate[VI_ONE_MODE_CONTACTS + 1]; /* free; on each stop, s and 1/s */
    vi_lane_array lag[VI_ONE_MODE_CONTACTS];     /* damping / stiffness of the stop, s */
    vi_lane_array yields[VI_ONE_MODE_CONTACTS];  /* 1: the stop yields */
    vi_lane_array force[VI_ONE_MODE_CONTACTS];   /* of the stop for depth + lag * rate = 1, N */
    vi_lane_array pressed_stop;               /* number of the stop that is pressed, from 1; 0: none */
    vi_lane_array receding;                   /* number of the stop beyond whose rest position the body flies; 0: none */
    vi_lane_array start_pressed;              /* pressed_stop in the last round */
    vi_lane_array cells_pressed, most_pressed; /* cells since the touch-down; number above which the point is left */
    vi_lane_array depth;                      /* at the separation of the last round */
    /* the touch-down of the present contact, if it is recorded (open = 1): instant, time, phases, speed of approach */
    vi_lane_array open, touch_periods, touch_rest, touch_rest_low, touch_time, touch_phase;
    vi_lane_array touch_cosine, touch_sine, touch_approach;
} vi_yielding;

/* Lengths of cells for bodies of several modes: each level has a quarter of the length of the one before. */
enum { VI_LEVELS = 5, VI_LEVEL_RATIO = 4, VI_POINTS = VI_LANES_CONTACTS + 1 };

/* Rows of the tables for one length of cells. */
typedef struct {
    vi_lane_array step[VI_REAL_MODES][4]; /* (q, p) after a cell: q of q, of p; p of q, of p */
    vi_lane_array turn_cosine, turn_sine;  /* turn of the force over a cell */
    vi_lane_array cells, rate;             /* length of a cell in shortest cells; its reciprocal, 1/s */
    /* largest deviation of a contact's displacement from a cubic over a cell: for unit amplitudes of the modes, then for
     * the force and rounding */
    vi_lane_array bulge[VI_LANES_CONTACTS][VI_REAL_MODES + 1];
} vi_level_rows;

/* Tables of a body of several modes. Its motion is the steady response plus the unforced motion of each real mode.
 * Real modes are those of the body, or real and imaginary parts of its complex modes (many_coupling.h). Rows of points: the contacts,
 * towards their stops, then the observed point. */
typedef struct {
    vi_level_rows rows[VI_LEVELS];                    /* of each level: the longest cells, ..., two shortest cells */
    vi_level_rows present;                            /* of the lane's level */
    vi_lane_array half[VI_REAL_MODES][4];            /* as `step`, over one shortest cell */
    vi_lane_array half_cosine, half_sine;
    vi_lane_array two[VI_REAL_MODES][4], two_cosine, two_sine; /* the same over two shortest cells */
    /* largest deviations of the observed displacement and velocity from a line over a cell, for unit amplitudes */
    vi_lane_array sag[VI_LEVELS][VI_REAL_MODES + 1], tilt[VI_LEVELS][VI_REAL_MODES + 1];
    /* Largest deviation of the observed displacement from a cubic over n shortest cells. It is the smaller of n^4 wave
     * and flat + n rise, for unit amplitudes of the modes, then for the force. */
    vi_lane_array wave[VI_REAL_MODES + 1], flat[VI_REAL_MODES + 1], rise[VI_REAL_MODES + 1];
    vi_lane_array shape[VI_POINTS][VI_REAL_MODES];
    vi_lane_array cosine[VI_POINTS], sine[VI_POINTS]; /* steady response */
    vi_lane_array rest_place[VI_POINTS], offset[VI_POINTS]; /* displacement under the held loads; the same minus stop */
    vi_lane_array mix[VI_REAL_MODES], reach[VI_REAL_MODES]; /* amplitude <= |q| + |p + mix q| reach */
    vi_lane_array level, start_level, last;           /* level: present; in the last round; shortest */
    /* for the search */
    vi_lane_array drag[VI_REAL_MODES], spring[VI_REAL_MODES]; /* q'' + drag q' + spring q = 0 over a shortest cell */
    vi_lane_array turn;                               /* of the force over a shortest cell, rad */
    vi_lane_array pull[VI_REAL_MODES];               /* bound of the acceleration for unit amplitude, 1/s^2 */
    vi_lane_array steady_pull[VI_LANES_CONTACTS];     /* bound of the acceleration of the steady response, m/s^2 */
    vi_lane_array stiffness[VI_REAL_MODES], decay[VI_REAL_MODES];
    vi_lane_array steady_cosine[VI_REAL_MODES], steady_sine[VI_REAL_MODES], rest[VI_REAL_MODES];
    vi_lane_array kick[VI_LANES_CONTACTS][VI_REAL_MODES]; /* modal velocities that take away a unit of approach */
    vi_lane_array shift[VI_LANES_CONTACTS][VI_REAL_MODES]; /* the same of q, for damping that couples the modes */
    vi_lane_array to_state[VI_LANES_MODES][VI_REAL_MODES]; /* then: displacement of a mode by each real mode */
    vi_lane_array size[VI_LANES_CONTACTS];            /* of the terms of a clearance that do not move, m */
} vi_many_modes;

/* The record of the lanes, in units of the group: the observed displacement is `scale` times such a number. */
typedef struct {
    vi_lane_array scale;                      /* m per unit of the group, of any sign */
    vi_lane_array unit[VI_LANES_CONTACTS];    /* m/s per unit of speed of the contact */
    vi_lane_array impulse[VI_LANES_CONTACTS]; /* N s for a change of the contact's speed by 1 m/s */
    vi_lane_array number[VI_LANES_CONTACTS];  /* number in the scene, from 1; of one mode: nearest contacts come first */
    vi_lane_array origin, origin_low;         /* of the clock */
    vi_lane_array point;                      /* number of the point */
    vi_lane_array impacts;                    /* 1: each impact is recorded */
    vi_lane_array extremes;                   /* 1: extremes are followed */
    vi_lane_array last_turn;                  /* whole periods of the clock at the last recorded strobe; -1: none */
    /* the open period */
    vi_lane_array most, least;                /* so far */
    vi_lane_array strobe, strobe_velocity;    /* at its start */
    vi_lane_array impacts_before;             /* number of impacts at its start */
    vi_lane_array open, turn;                 /* 1: there is one; whole periods of the clock at its start */
    /* 1: flights wait for their record; start of the present round, and impacts before it */
    vi_lane_array waits, from_periods, from_rest, from_rest_low, from_impacts;
    vi_lane_array doubtful;                   /* 1: `most` and `least` lack the last round, see `extremes` of the body */
} vi_lane_record;

/* Flights of a lane that wait for the record of their strobes and extremes, and most strobes of a round (see
 * VI_LONGEST_CELL). */
enum { VI_FLIGHTS = 64, VI_STROBES_OF_ROUND = 3 };

/* The record of one lane that waits: rigid stops, one mode. A flight covers some cells from a state. It is a round, or a
 * part of one between strobes. Many flights fill whole vectors, whatever the other lanes do. */
typedef struct {
    double q[VI_FLIGHTS], p[VI_FLIGHTS], cosine[VI_FLIGHTS], sine[VI_FLIGHTS]; /* at the start */
    double cells[VI_FLIGHTS], end_q[VI_FLIGHTS];
    double periods[VI_FLIGHTS], rest[VI_FLIGHTS]; /* of the clock at the start, for further sines */
    /* strobes: the start of the round, cells up to the strobe, whole periods of the clock, impacts before it */
    double from_q[VI_FLIGHTS], from_p[VI_FLIGHTS], from_cosine[VI_FLIGHTS], from_sine[VI_FLIGHTS];
    double from_periods[VI_FLIGHTS], from_rest[VI_FLIGHTS];
    double strobe_cells[VI_FLIGHTS], turn[VI_FLIGHTS], impacts[VI_FLIGHTS];
    int32_t strobes_before[VI_FLIGHTS];       /* of each flight */
    int32_t flight_before[VI_FLIGHTS];        /* of each strobe; the next flight begins there */
    int64_t flights, strobes, unused[6];      /* vectors stay aligned */
} vi_waiting_flights;

/* The time series of the lanes. */
typedef struct {
    vi_lane_array next, count;                /* number of the next sample, from 0; of all samples of the point */
    vi_lane_array time;                       /* of the next sample, s */
    /* instant from which the next samples are taken: the start of the last round; for one mode, the state there */
    vi_lane_array from_periods, from_rest, from_rest_low, from_q, from_p, from_cosine, from_sine, from_pressed;
} vi_lane_samples;

typedef struct {
    /* the body */
    vi_lane_array cell, cell_rate;            /* shortest cell, s; its reciprocal, 1/s */
    vi_lane_array angular_frequency, period, period_low;
    vi_lane_array sign[VI_LANES_CONTACTS], limit[VI_LANES_CONTACTS]; /* one mode: free while sign q < limit */
    vi_lane_array restitution[VI_LANES_CONTACTS], yield_velocity[VI_LANES_CONTACTS]; /* one mode: over |shape| */
    vi_lane_array resolution[VI_LANES_CONTACTS]; /* squared approach below which a touch may be no impact */
    vi_lane_array most_impacts;               /* number of impacts that makes an event */
    /* the state: modal displacements and velocities; for several modes, without the steady response and the level */
    vi_lane_array q[VI_REAL_MODES], p[VI_REAL_MODES];
    vi_lane_array periods, rest, rest_low;
    vi_lane_array goal_periods, goal_rest, goal_rest_low;
    vi_lane_array on;                         /* number of the contact just left, from 1; 0: none */
    vi_lane_array fastest_impact, impacts;
    /* the last round: its start, whole cells passed and the share of one more */
    vi_lane_array start_q[VI_REAL_MODES], start_p[VI_REAL_MODES], start_cosine, start_sine;
    vi_lane_array jumped, passed, share;      /* jumped: cells before those passed, in jumps over all cells of a round */
    vi_lane_array hit_pairs, hit_share;       /* whole pairs of the last flight to a contact, and share of one more */
    vi_lane_array hit_q, hit_p;               /* at the start of that one */
    vi_lane_array hit, approach;              /* number of the contact, from 1 (0: none), and its speed of approach */
    vi_lane_array event;
    vi_lane_record record;
    vi_lane_samples samples;
    vi_one_mode one;
    vi_yielding yielding;
    vi_many_modes many;
    vi_waiting_flights waiting[VI_LANES];     /* the members before it are arrays over the lanes */
    struct vi_lane_coupling *coupling;        /* workspace of bodies whose damping couples their modes; else NULL */
    vi_lane_sines *sines;                     /* further sines; NULL without one */
} vi_lane_group;

/* Number of real modes of a body alone. */
static inline int vi_own_modes(const vi_lanes_plan *plan)
{
    return plan->coupled ? 2 * plan->modes : plan->modes;
}

/* Number of real modes in a lane. Beside several modes each further sine is two undamped modes: its cosine and its sine.
 * Their shapes are the steady responses of the points. */
static inline int vi_real_modes(const vi_lanes_plan *plan)
{
    return vi_own_modes(plan) + (plan->modes > 1 ? 2 * plan->further : 0);
}

/* Number of further sines. */
static inline int vi_further_sines(const vi_lane_group *group)
{
    return group->sines == NULL ? 0 : (int)group->sines->count;
}

/* Most rounds in a row, each of which writes at most one impact of a lane. */
enum { VI_MOST_ROUNDS = 256 };

/* Move all lanes on together, round after round, until a lane has an event or VI_MOST_ROUNDS have passed. */
typedef void (*vi_lanes_rounds)(vi_lane_group *group, const vi_lanes_plan *plan, vi_lanes_points *points);

#endif
