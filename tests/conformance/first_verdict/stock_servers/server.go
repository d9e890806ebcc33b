// The right API of apps.py on Go's net/http: server PORT, in the folder of spec.json.
package main

import (
	"net/http"
	"os"
)

func main() {
	spec, _ := os.ReadFile("spec.json")
	for path, body := range map[string][]byte{"/state": []byte(`{"x":1.5}`), "/openapi.json": spec} {
		body := body
		http.HandleFunc(path, func(w http.ResponseWriter, r *http.Request) {
			if r.Method != "GET" && r.Method != "HEAD" {
				w.Header().Set("Allow", "GET, HEAD")
				w.WriteHeader(405)
				return
			}
			w.Header().Set("Content-Type", "application/json")
			w.Write(body)
		})
	}
	http.ListenAndServe("127.0.0.1:"+os.Args[1], nil)
}
