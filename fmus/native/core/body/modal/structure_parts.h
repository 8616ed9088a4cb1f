/* What the files of the structure engine share: questions about the present instant, and the moments of a contact. */
#ifndef VIBROIMPACT_STRUCTURE_PARTS_H
#define VIBROIMPACT_STRUCTURE_PARTS_H

#include "body/modal/coupled_flow.h"
#include "body/modal/modal_flight.h"
#include "body/modal/structure.h"

/* Rounding of a displacement, in units of the terms it is the sum of. */
#define VI_ROUNDING (4.0 * DBL_EPSILON)

/* ---- the present instant ---- */

double vi_structure_direction(const vi_structure *s, int k);
vi_phase vi_structure_phase(const vi_structure *s);
void vi_structure_held_now(const vi_structure *s, double held[]);

/* sign * shape . p: speed towards the stop, m/s */
double vi_structure_approach(const vi_structure *s, int k);

/* Clearance of contact k, m: exactly 0 where it is known to touch. */
double vi_structure_clearance(const vi_structure *s, int k);

/* Size of the terms that a displacement, or a velocity, of contact k is the sum of: velocities that displacements and
 * loads turn into within a radian are among them. */
double vi_structure_displacement_size(const vi_structure *s, int k);
double vi_structure_velocity_size(const vi_structure *s, int k);

/* Size of the terms that the acceleration of contact k for a unit force at contact l is the sum of, 1/kg. */
double vi_structure_push_size(const vi_structure_model *model, int k, int l);

/* Is this contact looked for? */
bool vi_structure_watched(const vi_structure *s, int k);

/* Is the point of contact k kept in place by the contacts that are held beside it? */
bool vi_structure_is_kept(const vi_structure *s, int k);

/* Does contact k stand at its stop, neither pressed in nor going to be, since rigid stops hold its point there? */
bool vi_structure_only_touches(const vi_structure *s, int k);

/* How contact k presses now. */
vi_press vi_structure_press(const vi_structure *s, int k);

/* Modal accelerations now, and the forces of held and yielding contacts; held ones may come out negative: they would
 * have to pull. */
void vi_structure_accelerate(const vi_structure *s, double acceleration[], double force[]);

/* The same without the forces of held contacts. */
void vi_structure_accelerate_freely(const vi_structure *s, double acceleration[], double force[]);

/* Add to a modal vector what a force (or impulse, over mass-normalised modes) of contact k on the body adds. */
/* Force of a yielding contact now, and its slopes. */
vi_contact_force vi_structure_yield(const vi_structure *s, int k);
void vi_structure_push(const vi_structure *s, int k, double force, double modal[]);

/* A matrix between contacts, seen from their stops: towards them counts positive. */
void vi_structure_signed(const vi_structure *s, double matrix[VI_PORTS][VI_PORTS], double g[VI_PORTS][VI_PORTS]);

/* A contact held at rest from now on: the plastic state, and the force that would hold it. */
typedef struct {
    double p[VI_MODES];
    double mobility;         /* of the contact with those held beside it, 1/kg */
    double pressure, slope, bend; /* acceleration towards the stop if it were free, and its rates, m/s^2, .. m/s^4 */
    double noise;            /* of the pressure */
    double free_noise;       /* of its acceleration with no contact held beside it, m/s^2 */
    int first;               /* the first Taylor coefficient, from the slope (1) on, that is more than rounding */
    double lead;             /* that one; 0: none */
} vi_held_view;

void vi_structure_look_at_held(const vi_structure *s, int k, vi_held_view *view);

/* ---- moments ---- */

/* External laws among the contacts that are hit: wait for their answers, or (FMI 2.0) note the time and fly through. */
bool vi_structure_ask(const vi_structure *s, const int hit[], bool stop_here);

/* Those that are hit: compliant stops begin to yield, rigid ones answer together. */
void vi_structure_resolve_hits(const vi_structure *s, const int hit[]);

/* Contact k has arrived at its stop (others may have, too): resolve it, or wait for an answer, or pass (FMI 2.0). */
void vi_structure_meet(const vi_structure *s, int k, bool stop_here);

/* Does contact k, which is free, meet its stop at this instant, as far as rounding can tell? */
bool vi_structure_meets_now(const vi_structure *s, int k);

/* Joint impulses of all contacts that touch with an approach; answers of external laws are used where `answered`. */
void vi_structure_collide(const vi_structure *s, const int hit[VI_PORTS]);

/* What the contacts that touch do now, after inputs or states changed: hit, rest, yield or leave. */
void vi_structure_settle(const vi_structure *s, const vi_step_request *request);

void vi_structure_rest(const vi_structure *s, int k, double delay, double tail_impulse);
void vi_structure_release(const vi_structure *s, int k, int leaving);
void vi_structure_touch_down(const vi_structure *s, int k);
void vi_structure_separate(const vi_structure *s, int k, bool receding);

/* A receding contact meets its surface: it presses again, or, moving out too fast for that, has a surface from now on
 * that follows it without force. */
void vi_structure_return(const vi_structure *s, int k);

/* Rounding of what has the sign of a compliant contact's force: the force itself or, of a power law, 1 + damping d'. */
double vi_structure_pressing_noise(const vi_structure *s, int k);

/* Does the surface of a receding compliant stop still lag behind, on its way back to rest? */
bool vi_structure_surface_lags(const vi_structure *s, int k);

/* Put the held contacts back on their stops, at rest: takes off what rounding has added. */
void vi_structure_project(const vi_structure *s);

/* Follow the coupled motion to its next event, the end of a segment or `length`, whichever is first; returns the time
 * moved. *k is the contact of the event, or -1. The state (q, p) is moved, the instant is not. Arrivals up to `room`
 * after the length count as at it. */
typedef enum {
    VI_DRIFT_NO_EVENT,
    VI_DRIFT_ARRIVAL,
    VI_DRIFT_RELEASE,
    VI_DRIFT_SEPARATION,
    VI_DRIFT_RETURN, /* to a compliant surface that it had left */
    VI_DRIFT_FREE    /* a receding contact is out, or its surface has relaxed */
} vi_drift_event;

/* Rounding of Taylor coefficient n >= 3 of contact k's motion, which is the sum of larger terms, m/s^n. */
double vi_structure_series_noise(const vi_structure *s, const vi_drift *drift, int k, int n);

/* The first coefficient, from the slope on, of the force of held contact k that is more than rounding; VI_ORDER + 1: none. */
int vi_structure_first_of_force(const vi_structure *s, const vi_drift *drift, int k);

double vi_structure_drift(const vi_structure *s, double length, double room, vi_drift_event *event, int *k);

/* ---- thin contacts: a power law so little pressed in that its force acts as an impulse ---- */

/* How long the force of power law k may act as that of a penetration at constant rate, s: within the tolerance, but no
 * shorter than moves it by a rounding of its displacement, else it would never get on. What ends that may still be to
 * come: it may begin without speed or, pressed in, where its damping leaves no force. */
double vi_thin_time(const vi_structure *s, int k, double rate, const double acceleration[]);

/* Give the impulse of a thin contact over u seconds of constant rate, to the state at the end. */
void vi_thin_impulse(const vi_structure *s, int k, double depth, double rate, double u);

/* What thin contacts at these depths, which the series leave out, add to the force of held contact k after u seconds;
 * *size: the sum of the moduli. */
double vi_thin_part(const vi_structure *s, const vi_drift *drift, const int thin[], const double at[], int k, double u,
                    double *size);

/* Is any contact held, yielding, receding, or lifted by a high derivative only, or is the damping coupled? */
bool vi_structure_is_coupled(const vi_structure *s);

/* ---- energies, when they are followed ---- */

/* How long a flight may be for its energies, s: HUGE_VAL when they are not followed. */
double vi_energies_reach(const vi_structure *s);
void vi_energies_of_flight(const vi_structure *s, const vi_flight *flight, const double held[], double u);
/* Contacts that are `still` do no work: what their series say of their motion is rounding. */
void vi_energies_of_drift(const vi_structure *s, const vi_drift *drift, const double held[], const int still[],
                          double u);
double vi_structure_kinetic(const vi_structure *s);

/* ---- extremes of the observed point ---- */

void vi_extremes_of_flight(const vi_structure *s, const vi_flight *flight, double u);
void vi_extremes_of_drift(const vi_structure *s, const vi_drift *drift, double u);

#endif
