/* Points of a plan, as the caller of the lanes gives them, and what they come to. */
#ifndef VIBROIMPACT_LANE_POINTS_H
#define VIBROIMPACT_LANE_POINTS_H

#include <stdint.h>

enum { VI_LANES_MODES = 8, VI_LANES_CONTACTS = 2 };

/* How far a point is. */
enum {
    VI_POINT_WAITS = 0,
    VI_POINT_RUNS = 1,
    VI_POINT_HAS_RUN = 2,
    VI_POINT_IS_LEFT = 3,    /* for the scalar engine: its rows, if there are any, are void */
    VI_POINT_IS_ANSWERED = 4 /* set by the caller, with outcome, final_q and final_p: the scalar engine has run it */
};

/* Instruction sets; 0: the best that the machine has. */
enum { VI_INSTRUCTIONS_BEST = 0, VI_INSTRUCTIONS_BASELINE = 1, VI_INSTRUCTIONS_AVX2 = 2, VI_INSTRUCTIONS_AVX512 = 3 };

/* What all points have in common. */
typedef struct {
    int32_t modes;    /* 1 to VI_LANES_MODES */
    int32_t contacts; /* 0 to VI_LANES_CONTACTS; each a rigid stop */
    int32_t impacts, extrema, periods; /* what is recorded between begin and end, as in record.h */
    int32_t instructions;
    int64_t impact_limit; /* of a run; 0: none */
} vi_lanes_plan;

/* The points. Arrays are [point], [mode][point], [contact][point] or [contact][mode][point], in SI units.
 *
 * A mode is q'' + 2 decay q' + stiffness q = force cos(phase) + held. A displacement is shape . q, and an impulse of
 * 1 N s at a contact adds `impulse` to q': modes are mass-normalised, or, of one mass, q is its displacement (shape 1,
 * impulse 1/mass). A force of angular frequency 0 is constant.
 */
typedef struct {
    int64_t count;
    const double *stiffness, *decay, *force, *held; /* [mode][point] 1/s^2, 1/s; force and held load per unit modal mass */
    const double *angular_frequency, *phase;        /* of the force at time 0, rad/s, rad */
    const double *shape, *impulse;                  /* [contact][mode][point] */
    const double *observed;                         /* [mode][point] shape of the point that rows and finals tell of */
    const double *position, *direction;             /* [contact][point] of the stop, m; +1: above the motion, -1: below */
    const double *restitution, *yield_velocity;     /* [contact][point] as contact_law.h has them */
    const double *start_q, *start_p;                /* [mode][point]; of the points that begin a branch */
    const double *begin, *end;                      /* of the recording, s */
    /* Here a branch begins (independent points: each). The next point of a branch starts at time 0 from the state where
     * the last one before it that came to its end (outcome 0) has ended. The first point of all counts as one. */
    const uint8_t *first;
    uint8_t *state;              /* all VI_POINT_WAITS at first */
    int8_t *outcome;             /* VI_RUN_ENDED or VI_RUN_IMPACT_LIMIT of runs.h */
    double *reached;             /* time where it ended, s */
    double *displacement, *velocity; /* there, of the observed point */
    double *final_q, *final_p;   /* there, [mode][point] */
    int64_t *rows_of;            /* rows of each: 0 again once it is left */
    /* Rows as record.h has them; those of one point are in the order of their time, among those of others. */
    double *rows;                /* [rows_room][VI_RECORD_WIDTH] */
    int64_t *owner;              /* [rows_room] point of each row */
    int64_t rows_room, rows_used; /* rows_room >= VI_LANES_LEAST_ROOM; the caller takes rows by rows_used = 0 */
    int64_t finished;            /* points that have run or are left since the first call */
    double most_seconds;         /* of one call */
} vi_lanes_points;

#endif
