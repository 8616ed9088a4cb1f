/* A body of N modes with stops: its model, its state, and functions of the present instant.
 *
 * Modes are mass-normalised: a modal displacement q_j has the unit kg^(1/2) m, and a modal force N kg^(-1/2). A shape,
 * the displacement of a point for q_j = 1, has the unit kg^(-1/2). equations.md 5, 6.
 *
 * A component keeps the parts (model, state, contacts, record) in its one flat struct and passes pointers to them.
 * Copying the struct copies the body.
 */
#ifndef VIBROIMPACT_MODAL_STATE_H
#define VIBROIMPACT_MODAL_STATE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "body/budget.h"
#include "body/complaint.h"
#include "body/record.h"
#include "contact/contact.h"
#include "modes/pressed_terms.h"
#include "motion/clock.h"
#include "motion/flow.h"
#include "motion/origin.h"
#include "motion/sines.h"
#include "signals/table.h"
#include "sizes.h"

/* The given motion of a stop, from its position: place + velocity (t - since) + amplitude cos(angular_frequency t + phase
 * + shift) + its table. All 0: the stop stands still. */
typedef struct {
    double velocity;                            /* m/s */
    double amplitude, angular_frequency, phase; /* m, rad/s, rad */
    double place, since, shift;                 /* m, s, rad; 0 until a parameter changes in the motion */
    int64_t first, knots;                       /* of its table; knots: 0 without a table */
} vi_stop_motion;

/* A mode whose motion is given: stop_motion.h. */
typedef struct {
    vi_stop_motion motion; /* a sine, whose amplitude is in the shapes, or the rest */
    vi_sine sine;
} vi_given_mode;

/* Constants after the start. */
typedef struct {
    /* set by the component */
    int32_t modes;         /* number of modes in use, 1 to VI_MODES */
    int32_t contacts;      /* number of ports in use, 0 to VI_PORTS */
    int32_t further;       /* further observed points; their shapes are behind those of the contacts */
    int32_t rows;          /* rows of shape in use: contacts + further; derived by vi_structure_prepare */
    int64_t given_modes;   /* the last modes have a given motion, that of stops; 0 where stops stand still */
    int64_t impact_limit;  /* most events of contacts since the start; 0: no limit */
    double tolerance;      /* relative error of a contact whose force is a power of the penetration */
    double displacement_limit; /* of all points of a motion that grows, m: it ends beyond; 0: no limit */
    int32_t ends_unbounded; /* end a motion that grows where its stops are out of reach? */
    int32_t unused;         /* no padding, which would be saved */
    vi_clock clock;
    int32_t sines;                 /* further sines: those of the modes, with their phases */
    vi_sine sine[VI_SINES_ROOM];
    vi_mode mode[VI_MODES]; /* set by vi_structure_mode, in ascending order of stiffness */
    double shape[VI_PORTS][VI_MODES];
    /* modal velocities after a unit impulse at the contact, kg^(-1/2); equal to shape except for collocation */
    double impulse[VI_PORTS][VI_MODES];
    double observed[VI_MODES]; /* shape of the point whose extremes and strobe the record keeps */
    int32_t varies;            /* modes follow the amplitude: they change at each step */
    int32_t coupled;           /* damping couples the modes: coupling[][] holds all damping */
    double coupling[VI_MODES][VI_MODES]; /* modal damping matrix, 1/s; only read when coupled */
    vi_stop_motion stop_motion[VI_STOPS_MOVE ? VI_PORTS : 1];
    vi_given_mode given[VI_STOPS_MOVE ? VI_MODES : 1];
    int64_t asks;              /* set at the start: does another component answer? 64 bits, to avoid padding */
    /* derived by vi_structure_prepare */
    int32_t at_observed[VI_PORTS];         /* is the contact at the observed point? */
    int32_t stop[VI_PORTS];                /* vi_stop_kind of the contact's law; derived by vi_structure_start */
    vi_press press[VI_PORTS];              /* of this component's stop that yields; set at the start */
    double mobility[VI_PORTS][VI_PORTS];   /* velocity of contact i for a unit impulse at contact j, 1/kg */
    double mobility_low[VI_PORTS][VI_PORTS]; /* its rounding, which would add up with one sign over elastic impacts */
    double compliance[VI_PORTS][VI_PORTS]; /* acceleration of contact i for a unit force at contact j, 1/kg */
    double fastest;                      /* largest rate of any mode, rad/s */
    double radian;                       /* 1 / fastest, s; 0 where nothing turns */
    double growth;                       /* largest growth of any mode, 1/s; 0 where no motion grows */
} vi_structure_model;

/* Status of a contact of a structure. */
typedef enum {
    VI_CONTACT_FREE = 0,
    VI_CONTACT_TOUCHING = 1, /* on the stop, neither pressed nor penetrating: the next motion decides */
    VI_CONTACT_HELD = 2,     /* sticks on a rigid stop */
    VI_CONTACT_YIELDING = 3, /* a compliant stop is pressed in */
    VI_CONTACT_RECEDING = 4  /* beyond the rest position of a compliant stop, whose surface it has left */
} vi_contact_status;

typedef struct {
    double forcing_work;  /* of all applied forces, J */
    double damping_loss;  /* J */
    double contact_loss;  /* work done on the stops, J */
} vi_energies;

/* The present contact with a compliant stop. */
typedef struct {
    double time, phase, velocity; /* start: time, s, phase, rad, and speed, m/s */
    double impulse;               /* so far, N s */
    double peak;                  /* largest force so far, N; followed where the contact is recorded */
    int64_t counted;              /* a period has counted it */
} vi_touch_down;

/* Model exchange: the importer integrates the modes and keeps the time. */
typedef struct {
    int32_t on;
    double displacement, velocity; /* nominal values of a mode, to which an integrator's tolerance is relative */
    double unresolved;             /* highest bounce that the integrator has failed to follow, as a modal displacement */
} vi_exchange;

/* Origin of the terms of a long rest, so that a rest that is cut equals a rest in one piece; see origin.h. */
typedef struct {
    vi_instant at;
    vi_complex part[VI_TERMS];                       /* terms at the origin */
    double held[VI_MODES];                           /* constant loads since the origin */
    double reached_q[VI_MODES], reached_p[VI_MODES]; /* state at the end of the last rest counted from here */
    double position[VI_PORTS], stiffness[VI_PORTS], damping[VI_PORTS]; /* of the stops on which the body rests */
    int64_t status[VI_PORTS];                        /* of all contacts */
    int64_t known;                                   /* 64 bits, to avoid padding, which would be saved */
} vi_rest_origin;

/* Impacts that impacts set off at one instant; all 0 once none is left. */
typedef struct {
    int64_t rounds; /* so far */
    double speed;   /* fastest approach so far, m/s */
} vi_cascade;

/* Why a motion that grows has ended. */
typedef enum { VI_BOUNDED = 0, VI_STOPS_OUT_OF_REACH = 1, VI_BEYOND_LIMIT = 2 } vi_unbounded;

typedef struct {
    vi_instant now;
    vi_standstill standstill;
    vi_cascade cascade;
    vi_budget budget;
    double q[VI_MODES], p[VI_MODES]; /* modal displacements and velocities */
    vi_phase phase;                  /* of the clock's force, as last evaluated */
    vi_instant further_at;           /* instant of `further` */
    vi_phase further[VI_SINES_ROOM]; /* of the further sines, as last evaluated */
    vi_sine_block harmonics;         /* of the further sines, likewise */
    vi_origin origin[VI_MODES];
    vi_rest_origin rest;
    vi_instant held_since;
    double held[VI_MODES], held_rate[VI_MODES]; /* modal forces of the inputs at held_since, and their slopes */
    int64_t degree;                             /* of the loads; above 1 held_since is the present instant */
    double higher[VI_HIGHER_ROOM][VI_MODES];    /* coefficients 2 to degree */
    double loads_last;                          /* time from now for which they are valid, s; HUGE_VAL for any time */
    /* with signals `held` has them; then these are the inputs alone, and the instant of the inputs */
    vi_instant input_since;
    double input[VI_LOADS_ROOM], input_rate[VI_LOADS_ROOM];
    double signal_value[VI_SIGNALS_ROOM];       /* of each signal at held_since */
    int32_t status[VI_PORTS];   /* vi_contact_status */
    int32_t pending;            /* 0, or the contact (1-based) whose external law must answer */
    int32_t passed;             /* 0, or the external contact that the last step passed through (FMI 2.0) */
    int32_t unbounded;          /* the motion has grown beyond its stops or its limit: vi_unbounded */
    int32_t unused;             /* no padding, which would be saved */
    int32_t follow_energies;    /* input: integrate `energies` */
    int32_t moved;              /* the instant at which the motion began has passed */
    vi_energies energies;
    vi_exchange exchange;
    int64_t power_level;        /* longest step in a contact with a power law: power_tables.h */
    int64_t series;             /* segments followed by series since a contact came to rest, or nearly ended */
    double fastest_impact[VI_PORTS]; /* largest approach since the last stick, m/s */
    int64_t low_impacts[VI_PORTS];   /* number of impacts in a row far below that approach */
    double tail_impulse[VI_PORTS];   /* of the chatter summed at the last stick, N s */
    /* touching: leaves with velocity exactly 0 (1), also with acceleration 0 (2), also with its rate 0 within rounding
     * (3). yielding: began at this instant at depth exactly 0, with speed (1) or without (2). */
    int32_t leaving[VI_PORTS];
    int32_t asking[VI_PORTS];        /* external contacts that wait for an answer at this instant */
    vi_touch_down touch_down[VI_PORTS];
    double surface[VI_PORTS];        /* compliant stops: penetration at the last separation, m */
    vi_instant separated[VI_PORTS];  /* instant of the last separation */
    double reference_penetration[VI_PORTS], reference_rate[VI_PORTS]; /* external force: the state given with it */
} vi_structure_state;

/* Modes of a body at rest on a contact: pressed_flow.h. */
typedef struct vi_pressed_cache vi_pressed_cache;

/* Samples of a body's flights: modal_scan.h. */
typedef struct vi_scan vi_scan;

/* Responses over steps in a contact with a power law: power_tables.h. */
typedef struct vi_power_tables vi_power_tables;

/* Loads that are signals of time: loads.h. */
typedef struct vi_signal_loads vi_signal_loads;

/* Derivatives of the motion over parameters: structure/parameter.h. */
typedef struct vi_sensitivities vi_sensitivities;

/* Pointers to the parts of one body, for the length of a call. */
typedef struct {
    vi_structure_model *model;
    vi_structure_state *state;
    vi_contact *contacts; /* array of model->contacts */
    vi_record *record;
    /* caches, no part of the state */
    vi_pressed_cache *pressed; /* NULL: long rests are followed by series, like short ones */
    vi_scan *scan;       /* NULL: flights are followed by certified steps only */
    vi_power_tables *power; /* NULL: contacts with a power law are followed by series only */
    vi_signal_loads *loads; /* NULL: there are none */
    vi_table tables;        /* of the motions of stops, behind each other */
    vi_sensitivities *sensitive; /* NULL: there are none */
} vi_structure;

/* Set mode j: natural angular frequency (rad/s; negative: the stiffness is minus its square), damping ratio and modal
 * amplitude of the harmonic force. A mode of frequency 0 has no damping. The clock must be started with the same angular frequency. */
void vi_structure_mode(vi_structure_model *model, int j, double natural, double damping_ratio, double force,
                       double angular_frequency);

/* Change the harmonic force from now on, at its present phase: modal amplitudes, and an angular frequency > 0 if the
 * clock counts a forcing. Modal displacements and velocities stay. */
void vi_structure_drive(const vi_structure *s, const double force[], double angular_frequency);

/* Put further sines on the modes, or change them: force[k][mode] are modal amplitudes. Angular frequencies are > 0 and
 * at most VI_SINES. Before the start, phase[] (rad) are those at time 0; afterwards NULL, and the present phases stay. */
void vi_structure_drive_further(const vi_structure *s, int sines, double (*force)[VI_MODES],
                                const double angular_frequency[], const double phase[]);

/* Number of further sines; a constant where a component has none. */
static inline int vi_structure_sines(const vi_structure_model *model)
{
    return VI_SINES > 0 ? model->sines : 0;
}

/* Degree of the loads; a constant where a component has none above 1. */
static inline int vi_structure_degree(const vi_structure *s)
{
    return VI_DEGREE > 1 ? (int)s->state->degree : 1;
}

/* Does the clock's force act alone, with loads that grow at most linearly? Some ways of following a motion need it. */
static inline bool vi_structure_is_plain(const vi_structure *s)
{
    return vi_structure_sines(s->model) == 0 && vi_structure_degree(s) == 1;
}

/* Derive the model's remaining members, after modes, shapes and impulses are set. */
void vi_structure_prepare(vi_structure_model *model);

/* Set modal input forces from now on, with slopes; the applied forces of external stops are read from the contacts. */
void vi_structure_hold(const vi_structure *s, const double held[], const double held_rate[]);

/* Complain of the place where time stands still, after VI_STEP_STANDSTILL. */
void vi_structure_complain(const vi_structure *s, char message[VI_MESSAGE_LENGTH]);

/* Number (1-based) of a contact that starts beyond its stop by more than rounding, else 0. The caller refuses it. */
int vi_structure_beyond(const vi_structure *s);

/* Number of modes in use. */
static inline int vi_structure_modes(const vi_structure_model *model)
{
    return VI_ONLY_MODES > 0 ? VI_ONLY_MODES : model->modes;
}

/* Number of modes that forces move, those of the bodies. */
static inline int vi_structure_free_modes(const vi_structure_model *model)
{
    return vi_structure_modes(model) - (VI_STOPS_MOVE ? (int)model->given_modes : 0);
}

/* May a motion of the structure grow by itself? */
static inline bool vi_structure_grows(const vi_structure_model *model)
{
    return VI_GROWING && model->growth > 0.0;
}

/* Longest flight of a motion that grows, s: its bounds hold for twice this time, e^2 times as large. */
static inline double vi_growth_reach(const vi_structure_model *model)
{
    return vi_structure_grows(model) ? 1.0 / model->growth : HUGE_VAL;
}

/* shape . vector */
static inline double vi_structure_at(const vi_structure_model *model, const double shape[], const double vector[])
{
    double sum = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        sum += shape[j] * vector[j];
    }
    return sum;
}

/* The part of shape . vector that is of the bodies. */
static inline double vi_structure_at_body(const vi_structure_model *model, const double shape[], const double vector[])
{
    double sum = 0.0;
    for (int j = 0; j < vi_structure_free_modes(model); ++j) {
        sum += shape[j] * vector[j];
    }
    return sum;
}

/* Do stops move? Some ways of following a motion need stops that stand still. */
static inline bool vi_structure_stops_move(const vi_structure_model *model)
{
    return VI_STOPS_MOVE && model->given_modes > 0;
}

/* Does the stop of contact k move? */
static inline bool vi_structure_stop_moves(const vi_structure_model *model, int k)
{
    bool moves = false;
    for (int j = vi_structure_free_modes(model); j < vi_structure_modes(model); ++j) {
        moves = moves || model->shape[k][j] != 0.0;
    }
    return moves;
}

/* Entry of the modal damping matrix, 1/s. */
static inline double vi_structure_damping(const vi_structure_model *model, int i, int j)
{
    return model->coupled ? model->coupling[i][j] : i == j ? 2.0 * model->mode[j].decay : 0.0;
}

/* Size of the damping force on mode i for these rates of the modes. */
static inline double vi_structure_drag_size(const vi_structure_model *model, int i, const double rates[])
{
    double size = 0.0;
    if (!model->coupled) {
        return fabs(2.0 * model->mode[i].decay * rates[i]);
    }
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        size += fabs(model->coupling[i][j] * rates[j]);
    }
    return size;
}


/* ---- the present instant ---- */

/* +1 for a stop above the motion, -1 for a stop below. */
static inline double vi_structure_direction(const vi_structure *s, int k)
{
    return vi_contact_direction(s->contacts[k].side);
}

/* Velocity of the stop of contact k at these modal velocities, m/s. */
static inline double vi_structure_stop_velocity(const vi_structure *s, int k, const double p[])
{
    double sum = 0.0;
    for (int j = vi_structure_free_modes(s->model); j < vi_structure_modes(s->model); ++j) {
        sum -= s->model->shape[k][j] * p[j];
    }
    return sum;
}

/* Present position of the stop of contact k, m. */
static inline double vi_structure_stop_position(const vi_structure *s, int k)
{
    double sum = s->contacts[k].position;
    for (int j = vi_structure_free_modes(s->model); j < vi_structure_modes(s->model); ++j) {
        sum -= s->model->shape[k][j] * s->state->q[j];
    }
    return sum;
}

vi_phase vi_structure_phase(const vi_structure *s);

/* Phases of the further sines. */
const vi_phase *vi_structure_further(const vi_structure *s);

/* Drive of the modes from now on; `held` is set to the present loads. */
vi_drive vi_structure_drive_now(const vi_structure *s, double held[]);

/* Set the forcing phase found at this instant; it agrees except for whole turns and the rounding of its angle. */
void vi_structure_phase_is(const vi_structure *s, vi_phase phase);

void vi_structure_held_now(const vi_structure *s, double held[]);

/* sign * shape . p: speed towards the stop, relative to a stop that moves, m/s */
static inline double vi_structure_approach(const vi_structure *s, int k)
{
    return vi_structure_direction(s, k) * vi_structure_at(s->model, s->model->shape[k], s->state->p);
}

/* Clearance of contact k, m; exactly 0 where the contact touches. */
double vi_structure_clearance(const vi_structure *s, int k);

/* Displacement of the observed point, m. */
double vi_structure_observed(const vi_structure *s);

/* A displacement of the observed point, without rounding that would put it beyond a rigid stop there. */
double vi_structure_within(const vi_structure *s, double displacement);

/* Sum of the sizes of the terms of a displacement, or of a velocity, of contact k. Velocities include the effects of
 * displacements and loads within a radian. */
double vi_structure_displacement_size(const vi_structure *s, int k);
double vi_structure_velocity_size(const vi_structure *s, int k);

/* Upper bound of contact k's acceleration, m/s^2, at lower cost; HUGE_VAL with a pressing stop or a sloping input. */
double vi_structure_most_acceleration(const vi_structure *s, int k);

/* Is the largest force of contact k followed? It is only where its impact is recorded. */
static inline bool vi_structure_follows_peak(const vi_structure *s, int k)
{
    return s->record->impacts && s->state->status[k] == VI_CONTACT_YIELDING && !s->contacts[k].earlier;
}

/* Is this contact searched for? */
static inline bool vi_structure_watched(const vi_structure *s, int k)
{
    return s->model->stop[k] != VI_NO_STOP && !s->state->passed;
}

/* Does any mode move? A body that stands still keeps its state to the last bit. */
static inline bool vi_structure_moves(const vi_structure *s)
{
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        if (s->state->p[j] != 0.0) {
            return true;
        }
    }
    return false;
}

/* Kinetic energy of the modes, J. */
double vi_structure_kinetic(const vi_structure *s);

#endif
