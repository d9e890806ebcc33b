// The publishers service, on encoding/xml.
package main

import (
	"encoding/xml"
	"fmt"
	"io"
	"math"
	"net/http"
	"os"
	"path/filepath"
	"strings"
)

const (
	publisher = "/turtlesim_publisher_ws"
	soap11    = "http://schemas.xmlsoap.org/soap/envelope/"
	namespace = "http://soap.turtlebot.mybot.org/"
)

type envelope struct {
	XMLName xml.Name
	Header  struct {
		Blocks []struct {
			XMLName xml.Name
			Must    string `xml:"http://schemas.xmlsoap.org/soap/envelope/ mustUnderstand,attr"`
		} `xml:",any"`
	} `xml:"http://schemas.xmlsoap.org/soap/envelope/ Header"`
	Body struct {
		Calls []call `xml:",any"`
	} `xml:"http://schemas.xmlsoap.org/soap/envelope/ Body"`
}

type call struct {
	XMLName xml.Name
	Request *struct {
		DepotX       *float64 `xml:"depot_x"`
		DepotY       *float64 `xml:"depot_y"`
		DestinationX *float64 `xml:"destination_x"`
		DestinationY *float64 `xml:"destination_y"`
		MessageCode  *int32   `xml:"message_code"`
		SourceX      *float64 `xml:"source_x"`
		SourceY      *float64 `xml:"source_y"`
	} `xml:"arg0"`
}

func soapService(contract, base string) http.Handler {
	mux := http.NewServeMux()
	mux.HandleFunc("/publishers.xsd", func(w http.ResponseWriter, r *http.Request) {
		http.ServeFile(w, r, filepath.Join(contract, "publishers.xsd"))
	})
	mux.HandleFunc(publisher, func(w http.ResponseWriter, r *http.Request) {
		switch {
		case r.Method == "GET" && strings.EqualFold(r.URL.RawQuery, "wsdl"):
			wsdl, err := os.ReadFile(filepath.Join(contract, "publishers.wsdl"))
			if err != nil {
				http.Error(w, "its WSDL cannot be read", http.StatusInternalServerError)
				return
			}
			w.Header().Set("Content-Type", "text/xml; charset=utf-8")
			io.WriteString(w, strings.ReplaceAll(string(wsdl), "http://127.0.0.1:5555", base))
		case r.Method != "POST":
			w.Header().Set("Allow", "POST")
			http.Error(w, "POST, and nothing else", http.StatusMethodNotAllowed)
		case !strings.HasPrefix(strings.ToLower(r.Header.Get("Content-Type")), "text/xml"):
			http.Error(w, "text/xml, and nothing else", http.StatusUnsupportedMediaType)
		default:
			w.Header().Set("Content-Type", "text/xml; charset=utf-8")
			name, code, why := process(http.MaxBytesReader(w, r.Body, largest))
			if why != "" {
				w.WriteHeader(http.StatusInternalServerError)
				fault := "<s:Fault><faultcode>s:%s</faultcode><faultstring>%s</faultstring></s:Fault>"
				enveloped(w, fmt.Sprintf(fault, code, escaped(why)))
				return
			}
			enveloped(w, fmt.Sprintf(`<t:%sResponse xmlns:t="%s"/>`, name, namespace))
		}
	})
	return mux
}

// Returns the operation's name, or a fault's code and what is wrong.
func process(content io.Reader) (name, code, why string) {
	var message envelope
	if err := xml.NewDecoder(content).Decode(&message); err != nil {
		return "", "Client", err.Error()
	}
	if message.XMLName.Space != soap11 {
		return "", "VersionMismatch", "this is SOAP 1.1"
	}
	for _, block := range message.Header.Blocks {
		if block.Must == "1" {
			return "", "MustUnderstand", block.XMLName.Local + " is not understood"
		}
	}
	if len(message.Body.Calls) != 1 {
		return "", "Client", "a Body has one child"
	}
	asked := message.Body.Calls[0]
	name = asked.XMLName.Local
	if asked.XMLName.Space != namespace || (name != "ExecuteCoffeeRequest" && name != "ExecuteDeliveryRequest") {
		return "", "Client", "there is no operation " + name
	}
	given := asked.Request
	if given == nil || given.MessageCode == nil {
		return "", "Client", "arg0 or its message_code is missing"
	}
	for _, value := range []*float64{
		given.DepotX, given.DepotY, given.DestinationX, given.DestinationY, given.SourceX, given.SourceY,
	} {
		if value == nil || math.IsInf(*value, 0) || math.IsNaN(*value) {
			return "", "Client", "a coordinate is missing, or not finite"
		}
	}
	if name == "ExecuteDeliveryRequest" && *given.MessageCode != 3 && *given.MessageCode != 4 {
		return "", "Client", fmt.Sprintf("message_code: %d is neither 3 nor 4", *given.MessageCode)
	}
	return name, "", ""
}

func escaped(text string) string {
	var written strings.Builder
	if err := xml.EscapeText(&written, []byte(text)); err != nil {
		return ""
	}
	return written.String()
}

func enveloped(w io.Writer, content string) {
	fmt.Fprintf(w, `%s<s:Envelope xmlns:s="%s"><s:Body>%s</s:Body></s:Envelope>`, xml.Header, soap11, content)
}
