/* Points of a plan, given by the caller of the lanes, and their results. */
#ifndef VIBROIMPACT_LANE_POINTS_H
#define VIBROIMPACT_LANE_POINTS_H

#include <stdint.h>

/* Most modes and contacts of a body, and most contacts that a body of one mode can meet: the nearest on each side.
 * VI_REAL_MODES: real modes, two for each mode where damping couples the modes. */
enum { VI_LANES_MODES = 8, VI_REAL_MODES = 2 * VI_LANES_MODES, VI_LANES_CONTACTS = 4, VI_ONE_MODE_CONTACTS = 2 };

/* Most sines of a point besides the first, and most whole periods of its clock with further sines: their phases are then
 * exact to rounding. */
enum { VI_FURTHER_SINES = 7 };
#define VI_MOST_TURNS 67108864.0

/* Columns of a row of an impact: time (s), phase (rad), approach (m/s), impulse (N s), contact (from 1), restitution,
 * duration (s), largest force (N).
 *
 * The largest force is NaN at a rigid stop. A contact that is open at the end of its run has NaN for its
 * impulse, restitution, duration and largest force. */
enum { VI_IMPACT_WIDTH = 8 };
/* Columns of a period, over its points: largest and smallest displacement (m), displacement (m) and velocity (m/s) at
 * its start, number of impacts. */
enum { VI_OF_LARGEST, VI_OF_SMALLEST, VI_OF_STROBE, VI_OF_STROBE_VELOCITY, VI_OF_IMPACTS, VI_PERIOD_WIDTH };

/* State of a point. */
enum {
    VI_POINT_WAITS = 0,
    VI_POINT_RUNS = 1,
    VI_POINT_HAS_RUN = 2,
    VI_POINT_IS_LEFT = 3,    /* left to the scalar engine: its rows, if any, are void */
    VI_POINT_IS_ANSWERED = 4 /* set by the caller with outcome, final_q and final_p: the scalar engine has run it */
};

/* Instruction sets; 0: the best set of the machine. */
enum { VI_INSTRUCTIONS_BEST = 0, VI_INSTRUCTIONS_BASELINE = 1, VI_INSTRUCTIONS_AVX2 = 2, VI_INSTRUCTIONS_AVX512 = 3 };

/* Common parameters of all points. */
typedef struct {
    int32_t modes;    /* 1 to VI_LANES_MODES */
    int32_t contacts; /* 0 to VI_LANES_CONTACTS; with stops that yield to VI_ONE_MODE_CONTACTS */
    int32_t impacts, extrema, periods; /* records between begin and end, as in record.h */
    int32_t each_period; /* 0: a single row stands for all periods of a point */
    int32_t instructions;
    int32_t coupled;      /* 1: `coupling` of the points is read, and damping may couple their modes */
    int32_t further;      /* sines besides the first, 0 to VI_FURTHER_SINES; of several modes, two of them count as a mode
                             each: see vi_real_modes */
    int64_t impact_limit; /* of a run; 0: no limit */
    int64_t yielding;     /* sum of 2^c over the contacts c that are stops that yield, of one mode; others are rigid */
    int64_t sampled;      /* sum of 2^c over the sampled contacts c, and 2^VI_LANES_CONTACTS for the observed point */
    double rate;          /* samples per s of the time series; 0: none */
} vi_lanes_plan;

/* The points. Arrays are [point], [mode][point], [contact][point] or [contact][mode][point], in SI units.
 *
 * A mode is q'' + 2 decay q' + stiffness q = force cos(phase) + held. A displacement is shape . q, and an impulse of 1
 * N s at a contact adds `impulse` to q'. So modes are mass-normalised; for a single mass q may be its displacement
 * (shape 1, impulse 1/mass). A force of angular frequency 0 is constant.
 * Further sines add force cos(phase) each, with frequencies of their own; the first sine keeps the clock.
 */
typedef struct {
    int64_t count;
    const double *stiffness, *decay, *force, *held; /* [mode][point] 1/s^2, 1/s; force and held load per unit modal mass */
    const double *angular_frequency, *phase;        /* of the force at time 0, rad/s, rad */
    const double *further_force;                    /* [further][mode][point] forces of the further sines */
    const double *further_frequency, *further_phase; /* [further][point] of them, rad/s, rad */
    const double *shape, *impulse;                  /* [contact][mode][point] */
    const double *coupling;                         /* [mode][mode][point] 1/s, of 2 decay on the diagonal; see `coupled` */
    const double *observed;                         /* [mode][point] shape of the observed point */
    const double *position, *direction;             /* [contact][point] of the stop, m; +1: above the motion, -1: below */
    const double *restitution, *yield_velocity;     /* [contact][point] as in contact_law.h */
    const double *contact_stiffness, *contact_damping; /* [contact][point] of a stop that yields: N/m, N s/m */
    const double *start_q, *start_p;                /* [mode][point]; of the points that begin a branch */
    const double *begin, *end;                      /* of the recording, s */
    /* Is the point the first of a branch? Independent points all are, and so is point 0. A later point starts at time 0
     * from the final state of the last point before it on its branch with outcome 0. */
    const uint8_t *first;
    uint8_t *state;              /* all VI_POINT_WAITS at first */
    int8_t *outcome;             /* VI_RUN_ENDED or VI_RUN_IMPACT_LIMIT of runs.h */
    double *reached;             /* time of the end, s */
    double *displacement, *velocity; /* at the end, of the observed point */
    double *final_q, *final_p;   /* at the end, [mode][point] */
    /* Periods of each point, as far as they have ended. Without each_period row 0 has the extremes of all periods, the
     * start of the last one and the mean number of impacts. A point with more than most_periods is left. */
    double *periods;             /* [VI_PERIOD_WIDTH][point][most_periods] */
    int64_t *periods_of;         /* number of ended periods of each point; 0 again once it is left */
    int64_t most_periods;
    /* Samples of each point from `begin` on, as far as it has run. Rows: displacement (m) and velocity (m/s) of each
     * sampled contact, then of the observed point. A point with more than most_samples is left. */
    double *samples;             /* [2 * number of sampled points][point][most_samples] */
    int64_t *samples_of;         /* number of samples of each point; 0 again once it is left */
    int64_t most_samples;
    int64_t *rows_of;            /* number of impacts of each point; 0 again once it is left */
    /* Impacts of one point are in the order of time, mixed with impacts of others. */
    double *rows;                /* [rows_room][VI_IMPACT_WIDTH] */
    int64_t *owner;              /* [rows_room] point of each row */
    int64_t rows_room, rows_used; /* rows_room >= VI_LANES_LEAST_ROOM; the caller takes rows by rows_used = 0 */
    int64_t begun_below;         /* only points below this number begin; `count` unless the caller stops early */
    int64_t finished;            /* points that have run or are left since the first call */
    double most_seconds;         /* of one call */
} vi_lanes_points;

#endif
