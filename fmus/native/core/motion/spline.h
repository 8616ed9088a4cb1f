/* Natural cubic splines through tables of instants and values: two derivatives are continuous, the second is 0 at both
 * ends. Before the first instant and after the last the spline goes on as a straight line, with no jump. */
#ifndef VIBROIMPACT_SPLINE_H
#define VIBROIMPACT_SPLINE_H

/* Tables behind each other: instants (s, ascending in each table), values, and second derivatives of the splines. */
typedef struct {
    const double *time, *value, *curvature;
} vi_knots;

/* A spline at one instant. */
typedef struct {
    double value, rate, curvature, jerk; /* and the first three derivatives */
    double left;                         /* time for which the jerk stays, s; HUGE_VAL behind the last knot */
} vi_spline_point;

/* Find the second derivatives at `count` >= 2 knots; room: count numbers of scratch. */
void vi_spline_prepare(const double time[], const double value[], int count, double curvature[], double room[]);

/* The spline through knots first to first + count - 1 at the instant time + time_low. */
vi_spline_point vi_spline_at(const vi_knots *knots, int first, int count, double time, double time_low);

#endif
