/* A body of N modes with stops: its model, where it is now, and questions about the present instant.
 *
 * Modes are mass-normalised: a modal displacement q_j has the unit kg^(1/2) m, a shape (the displacement of a point
 * for q_j = 1) kg^(-1/2), a modal force N kg^(-1/2). equations.md 5, 6.
 *
 * A component keeps the parts (model, state, contacts, record) in its one flat struct and calls with pointers to
 * them; copying the struct copies the body.
 */
#ifndef VIBROIMPACT_MODAL_STATE_H
#define VIBROIMPACT_MODAL_STATE_H

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
#include "sizes.h"

/* What does not change after the start. */
typedef struct {
    /* set by the component */
    int32_t modes;         /* in use, 1 to VI_MODES */
    int32_t contacts;      /* ports in use, 0 to VI_PORTS */
    int64_t impact_limit;  /* most events of contacts since the start; 0: no limit */
    double tolerance;      /* relative error of a contact whose force is a power of the penetration */
    vi_clock clock;
    vi_mode mode[VI_MODES]; /* by vi_structure_mode, in ascending order of natural frequency */
    double shape[VI_PORTS][VI_MODES];
    /* modal velocities that a unit impulse at the contact gives, kg^(-1/2); equal to shape but for collocation */
    double impulse[VI_PORTS][VI_MODES];
    double observed[VI_MODES]; /* shape of the point whose extremes and strobe the record keeps */
    int32_t varies;            /* modes follow the amplitude: others at each step */
    int32_t coupled;           /* the damping couples the modes: coupling[][] holds all of it */
    double coupling[VI_MODES][VI_MODES]; /* modal damping matrix, 1/s; only read when coupled */
    int64_t asks;              /* derived by vi_structure_start: does another component answer for a contact? 64 bits: no padding */
    /* derived by vi_structure_prepare */
    int32_t at_observed[VI_PORTS];         /* is the contact at the observed point? */
    int32_t stop[VI_PORTS];                /* vi_stop_kind of the contact's law; derived by vi_structure_start */
    vi_press press[VI_PORTS];              /* of a stop that yields and is no other component's; derived likewise */
    double mobility[VI_PORTS][VI_PORTS];   /* velocity of contact i for a unit impulse at contact j, 1/kg */
    double mobility_low[VI_PORTS][VI_PORTS]; /* its rounding: else it adds up over elastic impacts, always one way */
    double compliance[VI_PORTS][VI_PORTS]; /* acceleration of contact i for a unit force at contact j, 1/kg */
    double fastest;                      /* largest rate of any mode, rad/s */
    double radian;                       /* time in which that turns by one, s; 0 where nothing turns */
} vi_structure_model;

/* How a contact of a structure stands. */
typedef enum {
    VI_CONTACT_FREE = 0,
    VI_CONTACT_TOUCHING = 1, /* on the stop, neither pressed nor penetrating: the next motion decides */
    VI_CONTACT_HELD = 2,     /* rests on a rigid stop */
    VI_CONTACT_YIELDING = 3, /* a compliant stop is pressed in */
    VI_CONTACT_RECEDING = 4  /* beyond the rest position of a compliant stop, whose surface it has left */
} vi_contact_status;

typedef struct {
    double forcing_work;  /* of all applied forces, J */
    double damping_loss;  /* J */
    double contact_loss;  /* work done on the stops, J */
} vi_energies;

/* The contact with a compliant stop that is going on. */
typedef struct {
    double time, phase, velocity; /* when and how fast it began, s, rad, m/s */
    double impulse;               /* so far, N s */
    double peak;                  /* largest force so far, N; followed where the contact is recorded */
    int64_t counted;              /* a period has counted it */
} vi_touch_down;

/* Model exchange: the importer integrates the modes, and time does not run in here. */
typedef struct {
    int32_t on;
    double displacement, velocity; /* nominal, of a mode: what an integrator's tolerance is relative to */
    double unresolved;             /* highest bounce that the integrator has failed to follow, as a modal displacement */
} vi_exchange;

/* Where the terms of a long rest are counted from, so that a rest that is cut is the rest in one piece; see origin.h. */
typedef struct {
    vi_instant at;
    vi_complex part[VI_TERMS];                       /* then */
    double held[VI_MODES];                           /* constant loads meanwhile */
    double reached_q[VI_MODES], reached_p[VI_MODES]; /* at the end of the last rest counted from here */
    double position[VI_PORTS], stiffness[VI_PORTS], damping[VI_PORTS]; /* of the stops that it rests on */
    int64_t status[VI_PORTS];                        /* of all contacts */
    int64_t known;                                   /* 64 bits: no padding, whose bytes a saved state would show */
} vi_rest_origin;

typedef struct {
    vi_instant now;
    vi_standstill standstill;
    vi_budget budget;
    double q[VI_MODES], p[VI_MODES]; /* modal displacements and velocities */
    vi_phase phase;                  /* of the force, when it was last asked for */
    vi_origin origin[VI_MODES];
    vi_rest_origin rest;
    vi_instant held_since;
    double held[VI_MODES], held_rate[VI_MODES]; /* modal forces of the inputs at held_since, and their slopes */
    int32_t status[VI_PORTS];   /* vi_contact_status */
    int32_t pending;            /* 0, or the contact (1-based) whose external law must answer */
    int32_t passed;             /* 0, or the external contact that the last step passed through (FMI 2.0) */
    int32_t follow_energies;    /* input: integrate `energies` */
    int32_t moved;              /* it is no longer at the instant at which its motion began */
    vi_energies energies;
    vi_exchange exchange;
    int64_t series;             /* segments that have been followed by series since a contact came to rest, or nearly ended */
    double fastest_impact[VI_PORTS]; /* largest approach since the last stick, m/s */
    int64_t low_impacts[VI_PORTS];   /* impacts in a row that are far below it */
    double tail_impulse[VI_PORTS];   /* of the chatter summed at the last stick, N s */
    /* touching: leaves with velocity exactly 0 (1), with acceleration 0 too (2), with its rate 0 but for rounding (3);
     * yielding: began at this instant, at depth exactly 0, with speed (1) or without (2) */
    int32_t leaving[VI_PORTS];
    int32_t asking[VI_PORTS];        /* external contacts that wait for an answer at this instant */
    vi_touch_down touch_down[VI_PORTS];
    double surface[VI_PORTS];        /* compliant stops: penetration at the last separation, m */
    vi_instant separated[VI_PORTS];  /* and when */
    double reference_penetration[VI_PORTS], reference_rate[VI_PORTS]; /* external force: where it was given */
} vi_structure_state;

/* Modes of the body at rest on a contact: pressed_flow.h. */
typedef struct vi_pressed vi_pressed;

/* Samples of its flights: modal_scan.h. */
typedef struct vi_scan vi_scan;

/* The parts of one body, for the length of a call. */
typedef struct {
    vi_structure_model *model;
    vi_structure_state *state;
    vi_contact *contacts; /* model->contacts of them */
    vi_record *record;
    /* no part of its state */
    vi_pressed *pressed; /* NULL: long rests are followed by series, as short ones are */
    vi_scan *scan;       /* NULL: flights are followed by certified steps alone */
} vi_structure;

/* Mode j: natural angular frequency (rad/s, >= 0), damping ratio (>= 0) and modal amplitude of the harmonic force.
 * A mode of frequency 0 has no damping. The clock must be started with the same angular frequency. */
void vi_structure_mode(vi_structure_model *model, int j, double natural, double damping_ratio, double force,
                       double angular_frequency);

/* Another harmonic force from now on, at the phase that it has: modal amplitudes, angular frequency > 0 where the clock
 * counts one. Modal displacements and velocities stay. */
void vi_structure_drive(const vi_structure *s, const double force[], double angular_frequency);

/* After modes, shapes and impulses are set. */
void vi_structure_prepare(vi_structure_model *model);

/* New modal input forces from now on, with slopes; the applied forces of external stops are read from the contacts. */
void vi_structure_hold(const vi_structure *s, const double held[], const double held_rate[]);

/* Say where it stands after VI_STEP_STANDSTILL. */
void vi_structure_complain(const vi_structure *s, char message[VI_MESSAGE_LENGTH]);

/* Does a contact lie beyond its stop by more than rounding? (a start state is refused then); its number or 0 */
int vi_structure_beyond(const vi_structure *s);

/* Modes in use. */
static inline int vi_structure_modes(const vi_structure_model *model)
{
    return VI_ONLY_MODES > 0 ? VI_ONLY_MODES : model->modes;
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

/* Entry of the modal damping matrix, 1/s. */
static inline double vi_structure_damping(const vi_structure_model *model, int i, int j)
{
    return model->coupled ? model->coupling[i][j] : i == j ? 2.0 * model->mode[j].decay : 0.0;
}

/* Size of the damping force on mode i where the modes move at these rates. */
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

/* +1 for a stop above the motion, -1 for one below. */
static inline double vi_structure_direction(const vi_structure *s, int k)
{
    return vi_contact_direction(s->contacts[k].side);
}

vi_phase vi_structure_phase(const vi_structure *s);

/* What the forcing phase has been found to be at this instant, but for whole turns and the rounding of its angle. */
void vi_structure_phase_is(const vi_structure *s, vi_phase phase);

void vi_structure_held_now(const vi_structure *s, double held[]);

/* sign * shape . p: speed towards the stop, m/s */
static inline double vi_structure_approach(const vi_structure *s, int k)
{
    return vi_structure_direction(s, k) * vi_structure_at(s->model, s->model->shape[k], s->state->p);
}

/* Clearance of contact k, m: exactly 0 where it is known to touch. */
double vi_structure_clearance(const vi_structure *s, int k);

/* Displacement of the observed point, m. */
double vi_structure_observed(const vi_structure *s);

/* A displacement of the observed point, without the rounding that may put it beyond a rigid stop there. */
double vi_structure_within(const vi_structure *s, double displacement);

/* Size of the terms that a displacement, or a velocity, of contact k is the sum of: velocities that displacements and
 * loads turn into within a radian are among them. */
double vi_structure_displacement_size(const vi_structure *s, int k);
double vi_structure_velocity_size(const vi_structure *s, int k);

/* More than the size of the acceleration of contact k, m/s^2, which costs less to know; HUGE_VAL where a stop presses, or an
 * input slopes. */
double vi_structure_most_acceleration(const vi_structure *s, int k);

/* Is the largest force of contact k followed? Only where its impact is recorded. */
static inline bool vi_structure_follows_peak(const vi_structure *s, int k)
{
    return s->record->impacts && s->state->status[k] == VI_CONTACT_YIELDING && !s->contacts[k].earlier;
}

/* Is this contact looked for? */
static inline bool vi_structure_watched(const vi_structure *s, int k)
{
    return s->model->stop[k] != VI_NO_STOP && !s->state->passed;
}

/* Kinetic energy of the modes, J. */
double vi_structure_kinetic(const vi_structure *s);

#endif
