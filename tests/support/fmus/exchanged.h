/* A model for model exchange. The parameter `kind` chooses its events and faults. Its adapters are exchange2.c and
 * exchange3.c; they refuse each call in a wrong mode. */
#ifndef TEST_EXCHANGED_H
#define TEST_EXCHANGED_H

#include <stdbool.h>

/* Clocks, of FMI 3.0. */
enum { TICK = 40, FUSE };

/* Value references; 0 is the time. */
enum { X = 1, V, U, COUNT, KIND, AT, STEPS, NOMINALS, TIP, TIP_RATE, REALS, D = 20, X_RATE = 30, V_RATE };

/* Values of `kind`. */
enum {
    SPRING,           /* x'' = -x + u + d */
    BALL,             /* falls, and bounces at x = 0: state events */
    STAIRS,           /* counts at multiples of `at`, v becomes the count: time events */
    STEPPED,          /* stops where a completed step lies beyond x = `at`: a step event */
    ENDS_AT_EVENT,    /* asks for the end at the time event `at` */
    ENDS_AT_STEP,     /* asks for the end at a completed step beyond `at` */
    SHORT_RATES,      /* no derivative further than `at` s from the last completed step */
    SHORT_STATES,     /* takes no states there */
    NAN_RATES,        /* NaN derivatives there */
    SHORT_INDICATORS, /* no event indicators there */
    RESCALED,         /* at the time `at` states and nominal values become a million times as large */
    ENDLESS,          /* the time event `at` never settles */
    RATES_FAIL,       /* error of the derivatives from `at` on */
    RATES_END,        /* NaN derivatives from `at` on */
    STUCK,            /* a time event at the present time, again and again */
    RATES_FATAL,      /* fatal error of the derivatives from `at` on */
    FALLING,          /* a mass of `at` kg under gravity and the force u */
    PENDULUM, /* of 1 kg and 1 m: x is its angle; u pushes its tip along `tip`, the way of the tip to one side */
    WEAK, /* takes forces of 1000 N at most */
    LAST_FALL, /* falls, and asks for the end in the event mode after its first impact from outside */
    CLOCKED,          /* clocks: each tick adds 1 to v; a countdown of `at`, lit by the third, stops the mass */
    CAM,              /* turns uniformly; the tip is its lift 2 s / (1 + s^2), s = x - `at`, which u pushes */
    KINDS
};

/* Modes of an instance. */
typedef enum { STARTING, INITIALIZING, EVENT_MODE, CONTINUOUS } mode;
typedef enum { ANSWER_OK, ANSWER_DISCARD, ANSWER_ERROR, ANSWER_FATAL } answer;

typedef struct {
    double real[REALS];
    int d;
    double completed, next, scale; /* s; s; factor of states and nominal values */
    mode mode;
    bool settled, has_stopped;
    unsigned clock;    /* that ticks now; 0: none */
    bool is_lit;       /* the countdown runs, and the importer does not know yet */
    double fuse;       /* end of the countdown, s */
} exchanged;

typedef struct {
    bool again, ends, nominals, values, has_next;
} decisions;

void exchanged_start(exchanged *m);
bool exchanged_takes(const exchanged *m, mode wanted);
answer exchanged_states(exchanged *m, const double states[2]);
answer exchanged_rates(exchanged *m, double rates[2]);
answer exchanged_indicators(exchanged *m, double *indicator);
void exchanged_completed(exchanged *m, bool *event, bool *ends);
answer exchanged_update(exchanged *m, decisions *made);
/* False: the clock is not due. */
bool exchanged_tick(exchanged *m, unsigned clock);
bool exchanged_set_d(exchanged *m, int d);
bool exchanged_set_real(exchanged *m, unsigned reference, double value);
/* d(der(v))/du: the derivative of der(x) is 0. Of SHORT_RATES it is false. */
double exchanged_slope(const exchanged *m);
/* NAN for an unknown reference. */
double exchanged_real(const exchanged *m, unsigned reference);
#endif
