/* A structure of any modes and stops, for the tests in Python. */
#ifndef VIBROIMPACT_STRUCTURE_DOOR_H
#define VIBROIMPACT_STRUCTURE_DOOR_H

#include "door/door.h"
#include "sizes.h"

typedef struct vi_door_structure vi_door_structure;

/* One stop; `law` and `side` are numbers of ContactLaw and ContactSide. */
typedef struct {
    double law, side, position, restitution, yield_velocity, stiffness, damping, exponent, relaxation_time;
} vi_door_stop;

/* A structure of `modes` mass-normalised modes with `contacts` stops, at time 0. `coupling` is its modal damping matrix
 * (row-major) or NULL for damping ratios; shapes and impulses are (contacts, modes), row-major, `impulses` NULL for the
 * variational rule. NULL when an argument is out of range, or memory is out. */
VI_DOOR vi_door_structure *vi_door_structure_new(int modes, const double natural[], const double damping_ratio[],
                                                 const double force[], double angular_frequency, double phase,
                                                 const double coupling[], int contacts, const vi_door_stop stops[],
                                                 const double shapes[], const double impulses[], const double q[],
                                                 const double p[], double tolerance);
VI_DOOR void vi_door_structure_free(vi_door_structure *structure);

/* Follow long rests, and contacts with power laws, by series, in place of their exact flows. */
VI_DOOR void vi_door_structure_by_series(vi_door_structure *structure);

/* Take the steps of contacts with power laws from the first contact on: tables are made whether they repay or not. */
VI_DOOR void vi_door_structure_at_once(vi_door_structure *structure);

/* Record impacts and sticks, extremes of the point `observed`, periods; follow energies. */
VI_DOOR void vi_door_structure_record(vi_door_structure *structure, const double observed[], int impacts, int extrema,
                                      int periods, int energies);

/* End motions that grow beyond a displacement, m (0: none), and, where `ends_unbounded`, those that can meet no stop. */
VI_DOOR void vi_door_structure_limit(vi_door_structure *structure, double displacement_limit, int ends_unbounded);

/* Advance by up to `duration` s under constant modal forces; returns a vi_step_result. The time reached is in
 * vi_door_structure_state. */
VI_DOOR int vi_door_structure_advance(vi_door_structure *structure, double duration, const double held[],
                                      const double held_rate[], double most_impacts);

/* Write the reason why the last advance ended with this result; message has room for VI_MESSAGE_LENGTH. */
VI_DOOR void vi_door_structure_complaint(vi_door_structure *structure, int result, char message[]);

/* Modal displacements and velocities, contact statuses and forces; facts: time, forcing work, damping loss, contact
 * loss, displacement_max, displacement_min. */
VI_DOOR void vi_door_structure_state(vi_door_structure *structure, double q[], double p[], int status[], double force[],
                                     double facts[6]);

/* Work of all steps so far, in evaluations of one mode, and of the searches for modes at rest. */
VI_DOOR double vi_door_structure_work(const vi_door_structure *structure);

/* Move up to `room` rows of eight numbers (record.h) out of the record; returns their number. */
VI_DOOR int vi_door_structure_rows(vi_door_structure *structure, double rows[], int room);

#endif
