/* The functions that vibroimpact.fmus.core calls for an oscillator: the physics of the FMUs, one call at a time. */
#ifndef VIBROIMPACT_DOOR_H
#define VIBROIMPACT_DOOR_H

/* Exported from the library, whatever the compiler hides by default. */
#if defined(_WIN32)
#define VI_DOOR __declspec(dllexport)
#elif defined(__GNUC__)
#define VI_DOOR __attribute__((visibility("default")))
#else
#define VI_DOOR
#endif

/* A forced oscillator, SI units. */
typedef struct {
    double mass, damping, stiffness, amplitude, angular_frequency;
} vi_door_oscillator;

/* Displacement and velocity after `duration` s >= 0, without a stop, under a held acceleration `held` + `held_rate` *
 * time. state: displacement and velocity at forcing phase `phase`. Returns 0, or 1 for a bad argument. */
int vi_door_flow(const vi_door_oscillator *oscillator, double phase, const double state[2], double held,
                 double held_rate, double duration, double end[2]);

/* First contact within `duration` with a stop at `position` (side 1 upper, 2 lower). Returns 1 with the time from now
 * and the speed of approach in `contact`, 0 without a contact, -1 for a bad argument. */
int vi_door_next_contact(const vi_door_oscillator *oscillator, double phase, const double state[2], double position,
                         int side, double duration, double contact[2]);

/* The motion at `count` ascending instants (s from now) through impacts with a stop at `position`: displacement[count]
 * and velocity[count]. side: 1 upper, 2 lower, 0 no stop. Chatter is summed and rests end as in the FMUs. Returns the
 * number of impacts, -1 for a bad argument. */
int vi_door_motion(const vi_door_oscillator *oscillator, double phase, const double state[2], double position,
                   int side, double restitution, int count, const double instants[], double displacement[],
                   double velocity[]);

#endif
