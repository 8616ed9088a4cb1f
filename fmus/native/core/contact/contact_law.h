/* What a stop answers. The same functions serve the bodies (fused) and the ImpactStop FMU (coupled): a stop only
 * evaluates its law, the body alone resolves the contact.
 *
 * All laws are rows of one table. No other C file names one: they ask what kind of stop it is, and how it presses. */
#ifndef VIBROIMPACT_CONTACT_LAW_H
#define VIBROIMPACT_CONTACT_LAW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "contact/press.h"

enum { VI_SIDE_UPPER = 1, VI_SIDE_LOWER = 2 };

/* Parameters of a law at one stop. */
typedef struct {
    int64_t law;           /* number of its row */
    double restitution;    /* 0 to 1, below the yield velocity */
    double yield_velocity; /* above it restitution falls as (V / yield_velocity)^(-1/4), m/s; 0: it is constant */
    double stiffness;      /* N/m; of a power law N/m^exponent */
    double damping;        /* N s/m; of a power law chi of F = K d^n (1 + chi d'), s/m */
    double exponent;       /* of the law whose exponent is a parameter */
} vi_contact_law;

/* The force of a compliant stop and its slopes, at one penetration and rate of penetration. */
typedef struct {
    double force;     /* N, >= 0: a stop does not pull */
    double stiffness; /* its slope over penetration, N/m */
    double damping;   /* its slope over the rate, N s/m */
} vi_contact_force;

/* A range that one parameter of a law lies in. */
typedef struct {
    const char *parameter; /* NULL ends an array of rules */
    const char *expected;  /* in words */
    double least, most;
    size_t place; /* in vi_contact_law */
} vi_law_rule;

/* What a law has at a contact port. */
typedef enum {
    VI_NO_STOP = 0,
    VI_RIGID_STOP = 1,   /* it answers with an impulse */
    VI_YIELDING_STOP = 2 /* it answers with a force */
} vi_stop_kind;

/* A law: a row of the table, which descriptions of FMUs and scenes are made from too. */
typedef struct {
    const char *name; /* NULL: there is no law of this number */
    const char *description;
    vi_stop_kind stop;
    bool external; /* the importer gives the answer, or hits */
    const vi_law_rule *rules;
    /* of a law that yields and evaluates itself: the form of its force, whether it has a damping, its exponent (0: that is a
     * parameter), and the force for penetration > 0, before it is cut where it would pull */
    vi_press_kind press;
    bool damped;
    double exponent;
    vi_contact_force (*force)(const vi_press *press, double penetration, double rate);
} vi_law;

/* Numbers are below this; 0 is the law of a port in no use. */
enum { VI_MOST_LAWS = 32 }; /* a power of 2 */
extern const vi_law vi_laws[VI_MOST_LAWS];

/* Ranges of what a stop that answers with an impulse is given. */
extern const vi_law_rule vi_impact_rules[];

/* The law of a number. A number without a law is refused when a component starts; until then it has some row. */
static inline const vi_law *vi_law_of(int64_t number)
{
    return &vi_laws[(uint64_t)number % VI_MOST_LAWS];
}

/* Is there a law of this number? */
bool vi_contact_law_exists(int64_t law);

/* Number of the law of this name; -1: there is none. */
int64_t vi_contact_law_number(const char *name);

/* Laws of a port without a stop; with a rigid stop; with a stop that the importer is asked for the answer of. */
vi_contact_law vi_contact_law_none(void);
vi_contact_law vi_contact_law_rigid(double restitution);
vi_contact_law vi_contact_law_asking(void);

/* Does the parameter lie in its range, and is it finite? `value`: what it is. */
bool vi_law_rule_holds(const vi_law_rule *rule, const vi_contact_law *law, double *value);

/* Coefficient of restitution for a speed of approach (m/s, >= 0). */
double vi_contact_law_restitution(const vi_contact_law *law, double approach_velocity);

/* Force of a compliant law; all zero without penetration (m, > 0) or where it would pull. equations.md 6.9, 6.10 */
vi_contact_force vi_contact_law_force(const vi_contact_law *law, double penetration, double rate);

/* How a law presses with these parameters; of a law that does not yield the kind is VI_PRESS_NONE. */
static inline vi_press vi_law_press(const vi_law *law, const vi_contact_law *given)
{
    const double exponent = law->exponent > 0.0 ? law->exponent : given->exponent;
    return (vi_press){law->press, 0.0, given->stiffness, law->damped ? given->damping : 0.0, exponent};
}

/* Force of a law that yields, pressing so; all zero without penetration (m, > 0) or where it would pull. */
static inline vi_contact_force vi_law_force(const vi_law *law, const vi_press *press, double penetration, double rate)
{
    vi_contact_force f = {0.0, 0.0, 0.0};
    if (penetration > 0.0 && law->force != NULL) {
        f = law->force(press, penetration, rate);
    }
    return f.force > 0.0 ? f : (vi_contact_force){0.0, 0.0, 0.0};
}

/* Is the port in no use? */
static inline bool vi_contact_law_is_none(int64_t law)
{
    return law == 0;
}

/* Is there a stop that the body looks for by itself? */
static inline bool vi_contact_law_has_stop(int64_t law)
{
    return vi_law_of(law)->stop != VI_NO_STOP;
}

/* Does the stop answer with an impulse? */
static inline bool vi_contact_law_is_rigid(int64_t law)
{
    return vi_law_of(law)->stop == VI_RIGID_STOP;
}

/* Does the stop yield, and answer with a force? */
static inline bool vi_contact_law_yields(int64_t law)
{
    return vi_law_of(law)->stop == VI_YIELDING_STOP;
}

/* Does another FMU answer for the stop, or hit the point? */
static inline bool vi_contact_law_is_external(int64_t law)
{
    return vi_law_of(law)->external;
}

/* Is there a stop that another FMU answers for? */
static inline bool vi_contact_law_asks(int64_t law)
{
    return vi_contact_law_is_external(law) && vi_contact_law_has_stop(law);
}

/* Is there a stop whose law is evaluated here? */
static inline bool vi_contact_law_is_own(int64_t law)
{
    return !vi_contact_law_is_external(law) && vi_contact_law_has_stop(law);
}

/* +1 for a stop above the motion, -1 for one below: displacements times this approach the stop as they grow. */
static inline double vi_contact_direction(int64_t side)
{
    return side == VI_SIDE_LOWER ? -1.0 : 1.0;
}

#endif
