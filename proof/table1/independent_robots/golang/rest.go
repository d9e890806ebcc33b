// A robot on Go's net/http, whose ServeMux redirects by itself: robot CONTRACT (the folder with its WSDLs)
package main

import (
	"encoding/json"
	"errors"
	"fmt"
	"log"
	"math"
	"net"
	"net/http"
	"net/url"
	"os"
	"regexp"
	"sort"
	"strconv"
	"strings"
	"time"
)

// Returns a status and what is shown as JSON; nil is no content.
type handler func(http.ResponseWriter, *http.Request) (int, any, error)

type object = map[string]any

var (
	robot   = &body{now: time.Now(), until: time.Now()}
	decimal = regexp.MustCompile(`^[+-]?(\d+(\.\d+)?|\.\d+)([eE][+-]?\d+)?$`)
	integer = regexp.MustCompile(`^[+-]?\d+$`)
	ordered = []string{"depot_x", "depot_y", "dest_x", "dest_y", "source_x", "source_y"}
)

func readPose(http.ResponseWriter, *http.Request) (int, any, error) {
	return 200, object{
		"header":         header{stampOf(robot.now), text("odom")},
		"child_frame_id": "base_link",
		"pose":           object{"pose": at(robot.x, robot.y, robot.yaw), "covariance": diagonal(0.001)},
		"twist":          object{"twist": robot.twist(), "covariance": diagonal(0.0001)},
	}, nil
}

func text(value string) *string { return &value }

func putVelocity(w http.ResponseWriter, r *http.Request) (int, any, error) {
	var wanted twist
	if err := readJSON(w, r, &wanted); err != nil {
		return 0, nil, err
	}
	linear, angular := wanted.Linear, wanted.Angular
	return drive(linear.X, angular.Z, "linear.x", object{
		"linear.y": *linear.Y, "linear.z": *linear.Z, "angular.x": *angular.X, "angular.y": *angular.Y,
	})
}

func putLinear(w http.ResponseWriter, r *http.Request) (int, any, error) {
	var wanted vector
	if err := readJSON(w, r, &wanted); err != nil {
		return 0, nil, err
	}
	return drive(wanted.X, nil, "x", object{"y": *wanted.Y, "z": *wanted.Z})
}

func drive(v, w *float64, name string, still object) (int, any, error) {
	for field, value := range still {
		if value != 0.0 {
			return 0, nil, refuse(422, "%s: %v cannot be actuated", field, value)
		}
	}
	if math.Abs(*v) > limitLinear {
		return 0, nil, refuse(422, "%s: %v is beyond %v m/s", name, *v, limitLinear)
	}
	if w != nil && math.Abs(*w) > limitAngular {
		return 0, nil, refuse(422, "angular.z: %v is beyond %v rad/s", *w, limitAngular)
	}
	if robot.goal != nil {
		return 0, nil, refuse(409, "a goal is active")
	}
	robot.drive(*v, w)
	return 204, nil, nil
}

func shown(g *goal) object {
	head := header{stampOf(g.since), &g.frame}
	return object{
		"header": head, "goal_id": object{"stamp": head.Stamp, "id": g.id},
		"goal":   object{"target_pose": poseStamped{&head, &g.target}},
		"status": object{"code": 2, "text": ""},
	}
}

func getGoal(http.ResponseWriter, *http.Request) (int, any, error) {
	if robot.goal == nil {
		return 0, nil, refuse(404, "there is no goal")
	}
	return 200, shown(robot.goal), nil
}

func putGoal(w http.ResponseWriter, r *http.Request) (int, any, error) {
	var wanted actionGoal
	if err := readJSON(w, r, &wanted); err != nil {
		return 0, nil, err
	}
	target, where := wanted.Goal.TargetPose, "goal.target_pose"
	frame, position, q := *target.Header.FrameID, target.Pose.Position, target.Pose.Orientation
	if frame != "map" && frame != "odom" {
		return 0, nil, refuse(422, "%s.header.frame_id: %q is no frame of this robot", where, frame)
	}
	if length := math.Sqrt(*q.X**q.X + *q.Y**q.Y + *q.Z**q.Z + *q.W**q.W); !(math.Abs(length-1) <= 1e-3) {
		return 0, nil, refuse(422, "%s.pose.orientation: its length is %v", where, length)
	}
	id := ""
	if wanted.GoalID != nil {
		if id = *wanted.GoalID.ID; id == "" || len([]rune(id)) > 255 {
			return 0, nil, refuse(422, "goal_id.id: %q is no id", id)
		}
	}
	if math.Hypot(*position.X, *position.Y) > reach {
		return 0, nil, refuse(422, "%s.pose.position.x: %v is beyond this robot's reach", where, *position.X)
	}
	if active := robot.goal; active != nil && active.id == id {
		if fmt.Sprint(flat(active.target)) != fmt.Sprint(flat(*target.Pose)) {
			return 0, nil, refuse(409, "goal_id.id: %q has another pose", id)
		}
		return 204, nil, nil
	}
	return 202, shown(robot.send(id, frame, *target.Pose)), nil
}

func flat(p pose) [7]float64 {
	a, q := p.Position, p.Orientation
	return [7]float64{*a.X, *a.Y, *a.Z, *q.X, *q.Y, *q.Z, *q.W}
}

func deleteGoal(http.ResponseWriter, *http.Request) (int, any, error) {
	robot.goal = nil
	return 204, nil, nil
}

func getPlan(_ http.ResponseWriter, r *http.Request) (int, any, error) {
	query := r.URL.Query()
	values := map[string]float64{"start_x": robot.x, "start_y": robot.y, "start_yaw": 0, "yaw": 0, "tolerance": 0.1}
	if !query.Has("start_x") && !query.Has("start_y") {
		values["start_yaw"] = robot.yaw
	}
	for _, name := range []string{"x", "y", "yaw", "tolerance", "start_x", "start_y", "start_yaw"} {
		if !query.Has(name) {
			if _, may := values[name]; !may {
				return 0, nil, refuse(422, "%s: missing in the query", name)
			}
			continue
		}
		value, err := finite(query.Get(name), name, decimal)
		if err != nil {
			return 0, nil, err
		}
		values[name] = value
	}
	frame := "map"
	if query.Has("frame_id") {
		frame = query.Get("frame_id")
	}
	if frame != "map" && frame != "odom" {
		return 0, nil, refuse(422, "frame_id: %q is no frame of this robot", frame)
	}
	if values["tolerance"] < 0 {
		return 0, nil, refuse(422, "tolerance: %v is negative", values["tolerance"])
	}
	for _, name := range []string{"x", "y", "start_x", "start_y"} {
		if math.Abs(values[name]) > reach {
			return 0, nil, refuse(422, "%s: %v is beyond this robot's reach", name, values[name])
		}
	}
	head := header{stampOf(robot.now), &frame}
	poses := []object{}
	for _, one := range path(values["start_x"], values["start_y"], values["start_yaw"], values["x"], values["y"], values["yaw"]) {
		poses = append(poses, object{"header": head, "pose": one})
	}
	return 200, object{"plan": object{"header": head, "poses": poses}}, nil
}

func finite(text, name string, pattern *regexp.Regexp) (float64, error) {
	value, err := strconv.ParseFloat(text, 64)
	if !pattern.MatchString(text) || err != nil && math.IsInf(value, 0) {
		return 0, refuse(422, "%s: %.200q is no finite number", name, text)
	}
	return value, nil
}

// Reads /CODE/depot_x/VALUE/depot_y/VALUE/..., still percent-encoded; nil where the path is another one.
func delivery(path string) handler {
	parts := strings.Split(strings.TrimPrefix(path, "/robot/app/delivery/"), "/")
	if len(parts) != 1+2*len(ordered) {
		return nil
	}
	for i, name := range ordered {
		if parts[1+2*i] != name {
			return nil
		}
	}
	return func(http.ResponseWriter, *http.Request) (int, any, error) {
		for i := 0; i < len(parts); i += 2 {
			name, pattern := "code", integer
			if i > 0 {
				name, pattern = parts[i-1], decimal
			}
			decoded, err := url.PathUnescape(parts[i])
			if err != nil {
				return 0, nil, refuse(400, "%s: %s", name, err)
			}
			value, err := finite(decoded, name, pattern)
			if err == nil && i == 0 && value != 3 && value != 4 {
				err = refuse(422, "code: %v is neither 3 nor 4", decoded)
			}
			if err != nil {
				return 0, nil, err
			}
		}
		return 204, nil, nil
	}
}

func acceptsJSON(fields []string) bool {
	if accept := strings.Join(fields, ","); strings.TrimSpace(accept) != "" {
		quality := map[string]float64{}
		for _, member := range strings.Split(strings.ToLower(accept), ",") {
			name, parameters, _ := strings.Cut(strings.ReplaceAll(member, " ", ""), ";")
			quality[name] = 1
			for _, parameter := range strings.Split(parameters, ";") {
				if strings.HasPrefix(parameter, "q=") {
					quality[name], _ = strconv.ParseFloat(parameter[2:], 64)
				}
			}
		}
		for _, name := range []string{"application/json", "application/*", "*/*"} {
			if value, there := quality[name]; there {
				return value > 0
			}
		}
		return false
	}
	return true
}

func serve(w http.ResponseWriter, r *http.Request, methods map[string]handler) {
	allowed := []string{"OPTIONS"}
	for method := range methods {
		if allowed = append(allowed, method); method == "GET" {
			allowed = append(allowed, "HEAD")
		}
	}
	sort.Strings(allowed)
	method := r.Method
	if method == "HEAD" {
		method = "GET"
	}
	does := methods[method]
	var err error
	switch {
	case methods == nil:
		err = refuse(404, "there is no %.200q", r.URL.Path)
	case method == "OPTIONS":
		w.Header().Set("Allow", strings.Join(allowed, ", "))
		w.WriteHeader(204)
		return
	case does == nil:
		w.Header().Set("Allow", strings.Join(allowed, ", "))
		err = refuse(405, "there is no %.40s here", r.Method)
	case !acceptsJSON(r.Header.Values("Accept")):
		err = refuse(406, "Accept: %q has no JSON", r.Header.Values("Accept"))
	default:
		robot.Lock()
		defer robot.Unlock()
		robot.advance()
		status, value, failed := does(w, r)
		if err = failed; err == nil {
			show(w, status, "application/json", value)
		}
	}
	if answer := (refused{}); errors.As(err, &answer) {
		show(w, answer.status, "application/problem+json", object{"status": answer.status, "detail": answer.detail})
	}
}

func show(w http.ResponseWriter, status int, mediaType string, value any) {
	if value == nil {
		w.WriteHeader(status)
		return
	}
	octets, err := json.Marshal(value)
	if err != nil {
		log.Panic(err)
	}
	w.Header().Set("Content-Type", mediaType)
	w.Header().Set("Content-Length", strconv.Itoa(len(octets)))
	w.WriteHeader(status)
	w.Write(octets)
}

func constant(value any) handler {
	return func(http.ResponseWriter, *http.Request) (int, any, error) { return 200, value, nil }
}

func main() {
	resources := map[string]map[string]handler{
		"/robot/pose/": {"GET": readPose},
		"/robot/velocity/": {"GET": func(http.ResponseWriter, *http.Request) (int, any, error) {
			return 200, robot.twist(), nil
		}, "PUT": putVelocity},
		"/robot/velocity/linear/": {"GET": func(http.ResponseWriter, *http.Request) (int, any, error) {
			return 200, robot.twist().Linear, nil
		}, "PUT": putLinear},
		"/robot/sensors/":                {"GET": constant([]object{{"name": "lidar", "topic": "/scan", "type": "sensor_msgs/msg/LaserScan"}})},
		"/robot/navigation/services/":    {"GET": constant([]object{{"name": "/get_plan", "type": "nav_msgs/srv/GetPlan"}})},
		"/robot/navigation/action/goal/": {"GET": getGoal, "PUT": putGoal, "DELETE": deleteGoal},
		"/robot/navigation/service/plan": {"GET": getPlan},
	}
	mux := http.NewServeMux()
	for path, methods := range resources {
		path, methods := path, methods
		mux.HandleFunc(path, func(w http.ResponseWriter, r *http.Request) {
			if r.URL.Path == path {
				serve(w, r, methods)
			} else {
				serve(w, r, nil)
			}
		})
	}
	mux.HandleFunc("/robot/app/delivery/", func(w http.ResponseWriter, r *http.Request) {
		var methods map[string]handler
		if does := delivery(r.URL.EscapedPath()); does != nil {
			methods = map[string]handler{"PUT": does}
		}
		serve(w, r, methods)
	})
	mux.HandleFunc("/", func(w http.ResponseWriter, r *http.Request) { serve(w, r, nil) })
	rest, soap := listen(), listen()
	go func() { log.Fatal(http.Serve(soap, soapService(os.Args[1], "http://"+soap.Addr().String()))) }()
	fmt.Printf("ready rest=http://%s soap=http://%s%s?wsdl\n", rest.Addr(), soap.Addr(), publisher)
	log.Fatal(http.Serve(rest, mux))
}

func listen() net.Listener {
	listener, err := net.Listen("tcp", "127.0.0.1:0")
	if err != nil {
		log.Fatal(err)
	}
	return listener
}
